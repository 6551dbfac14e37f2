"""One walk draws two files: each must be what matplotlib itself writes in that format."""

from __future__ import annotations

import re
from io import BytesIO
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from PIL import Image

from reflectance_fit.plot.canvas import png_and_svg
from reflectance_fit.plot.style import PNG_DPI, RC

SVG = "{http://www.w3.org/2000/svg}"
NUMBER = re.compile(r"-?\d+\.?\d*(?:e-?\d+)?")


@pytest.fixture(autouse=True)
def _style():
    # Letters as their outlines, as the canvas draws them: without hinting.
    with matplotlib.rc_context({**RC, "text.hinting": "none"}):
        yield


def every_kind():
    """One of each thing that a picture is made of."""
    figure = Figure(figsize=(5.0, 3.0))
    ax, other = figure.subplots(1, 2)
    x = np.linspace(0, 1, 60)
    ax.plot(x, x**2, linestyle="--", label="dashed")
    ax.errorbar(x[::12], x[::12], yerr=0.1, fmt="s", markeredgecolor="white")
    ax.fill_between(x, x - 0.1, x + 0.1, alpha=0.3)
    ax.axvspan(0.2, 0.4, alpha=0.2)
    ax.set_ylabel("upright, η (deg)")
    ax.set_title("χ² ± <&>")
    ax.tick_params(axis="x", labelrotation=45)
    ax.legend()
    other.contour(x, x, np.hypot(x, x[:, None]), [0.3, 0.6])
    image = other.imshow(np.arange(12.0).reshape(3, 4), extent=(0, 1, 0, 1))
    image.set_clip_path(Circle((0.5, 0.5), 0.4, transform=other.transData))
    other.plot(x, 1 - x, ".", rasterized=True)
    other.text(0.5, 0.5, "slanted", rotation=30)
    return figure


def by_matplotlib(kind):
    file = BytesIO()
    metadata = {"png": {"Software": None}, "svg": {"Date": None, "Creator": None}}[kind]
    every_kind().savefig(file, format=kind, dpi=PNG_DPI, metadata=metadata)
    return file.getvalue()


def test_the_png_is_the_one_that_matplotlib_draws():
    ours = Image.open(BytesIO(png_and_svg(every_kind())["png"]))
    theirs = Image.open(BytesIO(by_matplotlib("png"))).convert("RGB")
    assert ours.mode == "RGB"
    assert ours.info["dpi"] == pytest.approx((PNG_DPI, PNG_DPI), abs=0.1)
    difference = np.abs(np.asarray(ours, float) - np.asarray(theirs, float))
    # Letters are placed to a fraction of a pixel here, and to a 64th there; all else is equal.
    assert np.mean(difference.max(axis=2) > 48) < 0.004
    assert difference.mean() < 0.5


def elements(svg):
    """Every drawn element in order: its name and its numbers, transforms of texts included."""
    found = []
    for element in ElementTree.fromstring(svg).iter():
        name = element.tag.removeprefix(SVG)
        wanted = {
            "path": ["d"],
            "use": ["x", "y"],
            "image": ["x", "y", "width", "height"],
            "g": ["transform"],
        }
        wanted |= {"rect": ["x", "y", "width", "height"], "svg": ["width", "height", "viewBox"]}
        values = [element.get(key, "") for key in wanted.get(name, [])]
        found.append((name, element.get("style", ""), [float(v) for t in values for v in NUMBER.findall(t)]))
    return found


def test_the_svg_is_the_one_that_matplotlib_writes():
    ours, theirs = elements(png_and_svg(every_kind())["svg"]), elements(by_matplotlib("svg"))
    assert [e[:2] for e in ours] == [e[:2] for e in theirs]
    assert {e[0] for e in ours} >= {"path", "use", "image", "rect", "g", "clipPath"}
    for (name, _, one), (_, _, two) in zip(ours, theirs, strict=True):
        # Half a point: pixels, to which matplotlib rounds the place of a text or an image, are as large.
        assert one == pytest.approx(two, abs=0.5, rel=0.002), name


def test_a_figure_is_drawn_alike_twice():
    figure = every_kind()
    assert png_and_svg(figure) == png_and_svg(figure)


def test_a_cloud_is_a_picture_in_the_svg_and_the_same_pixels_in_the_png():
    def cloud(rasterized):
        figure = Figure(figsize=(3, 2))
        ax = figure.subplots()
        ax.plot(np.random.default_rng(0).random(3000), ".", alpha=0.3, rasterized=rasterized)
        return png_and_svg(figure)

    points, picture = cloud(False), cloud(True)
    assert points["png"] == picture["png"]
    assert points["svg"].count(b"<use") - picture["svg"].count(b"<use") == 3000
    assert b"<image" not in points["svg"]
    assert picture["svg"].count(b"<image") == 1
    assert len(picture["svg"]) < 0.3 * len(points["svg"])
