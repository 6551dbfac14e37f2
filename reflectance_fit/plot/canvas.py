"""One walk over a figure, two pictures of it: PNG and SVG.

Most of what a picture costs is matplotlib's walk over its artists: ticks,
texts, transforms.  matplotlib walks once for each format; here every stroke
goes to both renderers as it is drawn, so that the two cannot differ either.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from io import BytesIO, StringIO
from typing import Any, cast

import numpy as np
from matplotlib.backend_bases import GraphicsContextBase, RendererBase
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.path import Path
from matplotlib.textpath import TextToPath, text_to_path
from matplotlib.transforms import Affine2D, Bbox, Transform, TransformedPath
from PIL import Image

# zlib's default level takes twice the time of this one and saves a tenth of the file.
_COMPRESSION = 1


# Neither has type information.
_RASTER: Any = RendererAgg
_VECTOR: Any = RendererSVG


def png_and_svg(figure: Figure) -> dict[str, bytes]:
    """The figure at its own dpi as ``{"png": ..., "svg": ...}``, with no date and no random identifier."""
    text = StringIO()
    both = _Both(figure, text)
    figure.draw(both)
    both.svg.finalize()
    pixels = BytesIO()
    # Without the fourth channel: the page is opaque.
    image = Image.frombuffer("RGBA", both.get_canvas_width_height(), both.png.buffer_rgba())
    image.convert("RGB").save(pixels, "png", compress_level=_COMPRESSION, dpi=(figure.dpi, figure.dpi))
    return {"png": pixels.getvalue(), "svg": text.getvalue().encode()}


class _Both(RendererBase):
    """Draws everything twice: in pixels on a raster, and in points (1/72 inch) as SVG.

    Artists speak pixels; line widths and font sizes are points for both.
    """

    def __init__(self, figure: Figure, file: StringIO) -> None:
        super().__init__()
        width, height = figure.canvas.get_width_height()
        self._size = width, height, figure.dpi
        self._points = 72.0 / figure.dpi
        self._layer: Any = None
        self.png = _RASTER(*self._size)
        self.svg = _VECTOR(
            width * self._points,
            height * self._points,
            file,
            image_dpi=figure.dpi,
            metadata={"Date": None, "Creator": None},
        )
        self.svg._text2path = _TEXT

    def _each(self, gc: GraphicsContextBase) -> Iterator[tuple[Any, GraphicsContextBase, float]]:
        """Where to draw, how, and the length there of a pixel."""
        yield self.png, gc, 1.0
        if self._layer is None:
            yield self.svg, _scaled_clip(gc, self._points), self._points
        else:
            yield self._layer, gc, 1.0

    def draw_path(
        self, gc: GraphicsContextBase, path: Any, transform: Transform, rgbFace: Any = None
    ) -> None:
        for renderer, own, scale in self._each(gc):
            renderer.draw_path(own, path, _scaled(transform, scale), rgbFace)

    def draw_markers(
        self,
        gc: GraphicsContextBase,
        marker_path: Any,
        marker_trans: Transform,
        path: Any,
        trans: Transform,
        rgbFace: Any = None,
    ) -> None:
        for renderer, own, scale in self._each(gc):
            shape, place = _scaled(marker_trans, scale), _scaled(trans, scale)
            renderer.draw_markers(own, marker_path, shape, path, place, rgbFace)

    def draw_image(self, gc: GraphicsContextBase, x: float, y: float, im: Any, transform: Any = None) -> None:
        for renderer, own, scale in self._each(gc):
            renderer.draw_image(own, x * scale, y * scale, im)

    def draw_text(
        self,
        gc: GraphicsContextBase,
        x: float,
        y: float,
        s: str,
        prop: Any,
        angle: float,
        ismath: Any = False,
        mtext: Any = None,
    ) -> None:
        # The letters' outlines in both: the SVG refers to each letter once, the raster fills them.
        size = self.points_to_pixels(prop.get_size_in_points()) / _TEXT.FONT_SCALE
        place = Affine2D().scale(size).rotate_deg(angle).translate(x, self._size[1] - y)
        filled = self.new_gc()
        filled.copy_properties(gc)
        filled.set_linewidth(0.0)
        self.png.draw_path(filled, _outline(s, prop.copy()), place, gc.get_rgb())
        own = _scaled_clip(gc, self._points)
        self.svg.draw_text(own, x * self._points, y * self._points, s, prop, angle, ismath, mtext)

    def get_text_width_height_descent(self, s: str, prop: Any, ismath: Any) -> tuple[float, float, float]:
        width, height, descent = _extent(s, prop)
        return width / self._points, height / self._points, descent / self._points

    def points_to_pixels(self, points: Any) -> Any:
        return points / self._points

    def get_canvas_width_height(self) -> tuple[int, int]:
        return self._size[:2]

    def open_group(self, s: str, gid: str | None = None) -> None:
        if self._layer is None:
            self.svg.open_group(s, gid)

    def close_group(self, s: str) -> None:
        if self._layer is None:
            self.svg.close_group(s)

    def start_rasterizing(self) -> None:
        """What follows, a cloud of points, goes into the SVG as a picture of it."""
        self._layer = _RASTER(*self._size)

    def stop_rasterizing(self) -> None:
        layer = Image.frombuffer("RGBA", self.get_canvas_width_height(), self._layer.buffer_rgba())
        self._layer = None
        drawn = layer.getchannel("A").getbbox()
        if drawn is not None:
            left, _, _, bottom = drawn
            place = left * self._points, (self._size[1] - bottom) * self._points
            # Renderers count an image's rows from below.
            self.svg.draw_image(self.new_gc(), *place, np.asarray(layer.crop(drawn))[::-1])


class _Remembering(TextToPath):
    """Lays out each text once: the same numbers and words stand on picture after picture."""

    def get_glyphs_with_font(
        self, font: Any, s: str, glyph_map: Any = None, return_new_glyphs_only: bool = False, **_: Any
    ) -> tuple[Any, Any, Any]:
        glyphs, outlines, boxes = _laid_out(font, s)
        known = glyph_map or {}
        return glyphs, {name: outline for name, outline in outlines.items() if name not in known}, boxes


_TEXT = _Remembering()


@lru_cache(4096)
def _laid_out(font: Any, text: str) -> tuple[Any, Any, Any]:
    laid_out: tuple[Any, Any, Any] = text_to_path.get_glyphs_with_font(font, text)
    return laid_out


@lru_cache(4096)
def _outline(text: str, font: FontProperties) -> Path:
    vertices, codes = _TEXT.get_text_path(font, text)
    return Path(vertices, codes)


@lru_cache(4096)
def _extent(text: str, font: FontProperties) -> tuple[float, float, float]:
    """Width, height and descent in points."""
    extent: tuple[float, float, float] = _TEXT.get_text_width_height_descent(text, font, False)
    return extent


def _scaled(transform: Transform, scale: float) -> Transform:
    return transform if scale == 1.0 else Affine2D(transform.get_matrix()).scale(scale)


def _scaled_clip(gc: GraphicsContextBase, scale: float) -> GraphicsContextBase:
    """A copy whose limits are scaled; everything else it holds is in points already."""
    copy = GraphicsContextBase()
    copy.copy_properties(gc)
    rectangle = gc.get_clip_rectangle()
    if rectangle is not None:
        copy.set_clip_rectangle(Bbox(rectangle.get_points() * scale))
    path, transform = gc.get_clip_path()
    if path is not None and transform is not None:
        # Typed as a TransformedPath, it is the Path inside one.
        copy.set_clip_path(TransformedPath(cast(Path, path), transform + Affine2D().scale(scale)))
    return copy
