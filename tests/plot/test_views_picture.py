"""Pictures of what a view shows: whole, with units, nothing cut, whatever the maps hold."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread

from reflectance_fit.plot.style import save
from reflectance_fit.plot.views import draw_view
from reflectance_fit.views import StokesMaps, ViewMaps

Y, X = np.mgrid[:60, :80].astype(float)
DISTANCE = np.hypot(X - 40, Y - 30) / 29


def ball(dolp=0.8):
    rng = np.random.default_rng(0)
    azimuth = np.arctan2(30 - Y, X - 40) + np.pi / 2
    stokes = StokesMaps(
        1 + 5 * DISTANCE**6,
        dolp * np.cos(2 * azimuth),
        dolp * np.sin(2 * azimuth),
        0.003 * rng.normal(size=X.shape),
    )
    inside = (DISTANCE < 0.97) & (DISTANCE > 0.1)
    theta = np.arcsin(np.where(inside, DISTANCE, np.nan))
    none = np.zeros(inside.shape, dtype=bool)
    masked = {"highlights and dust": inside & (np.hypot(X - 50, Y - 20) < 3), "clipped": none}
    return ViewMaps("set 0", "G", 100, 60, 6, stokes, theta, inside, masked)


def flat():
    view = ball()
    stokes = StokesMaps(0.9 + 0.001 * X, np.full(X.shape, 0.95), np.full(X.shape, 0.01), None)
    return replace(view, stokes=stokes, theta=np.array(np.radians(55.0)), inside=np.ones(X.shape, dtype=bool))


def nothing():
    """Two views: no polarization known, and every cell masked."""
    unknown = np.full(X.shape, np.nan)
    view = flat()
    everything = {"stray light": np.ones(X.shape, dtype=bool)}
    return replace(view, stokes=StokesMaps(unknown, unknown, unknown, None), masked=everything)


VIEWS = {"ball": ball, "flat": flat, "unpolarized": lambda: ball(0.0), "nothing": nothing}


@pytest.mark.parametrize("name", VIEWS)
def test_a_view_is_drawn_whole(name, tmp_path):
    paths = save(draw_view(VIEWS[name]()), tmp_path, "view-01")
    assert sorted(path.suffix for path in paths) == [".png", ".svg"]
    assert imread(paths[0]).std() > 0.02
    again = save(draw_view(VIEWS[name]()), tmp_path, "view-02")
    assert [path.read_bytes() for path in paths] == [path.read_bytes() for path in again]


@pytest.mark.parametrize("name", VIEWS)
def test_no_text_is_cut_or_covered(name):
    figure = draw_view(VIEWS[name]())
    figure.draw_without_rendering()
    texts = [
        text for ax in figure.axes for text in (ax.title, ax.xaxis.label, ax.yaxis.label) if text.get_text()
    ]
    boxes = [(text.get_text(), text.get_window_extent()) for text in (*texts, *figure.texts)]
    for i, (text, box) in enumerate(boxes):
        assert box.x0 >= 0, text
        assert box.x1 <= figure.bbox.x1, text
        assert box.y1 <= figure.bbox.y1, text
        assert box.y0 >= 0, text
        for other, second in boxes[:i]:
            assert not box.overlaps(second), (text, other)


def test_shares_and_angles_are_told():
    figure = draw_view(ball())
    titles = " ".join(ax.get_title(loc="left") for ax in figure.axes)
    assert "used: 98" in titles
    legend = [
        text.get_text() for ax in figure.axes if ax.get_legend() for text in ax.get_legend().get_texts()
    ]
    assert len(legend) == 1
    assert legend[0].startswith("highlights and dust 1 %")
    words = " ".join(text.get_text() for ax in draw_view(flat()).axes for text in ax.texts)
    assert "55°" in words
    assert "take a fourth" in words
