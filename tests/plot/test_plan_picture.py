"""The picture of a plan: units on its axes, the chosen design in it, and nothing cut off."""

import numpy as np
import pytest
from matplotlib._pylab_helpers import Gcf
from matplotlib.colors import to_hex

from reflectance_fit.plot.plan import Curve, draw_plan
from reflectance_fit.plot.style import save


def curves(x, mark):
    x = np.array(x, dtype=float)
    for i, label in enumerate(("analyzer", "lamp polarizer", "quarter-wave plate")):
        scale = 10.0 ** -(i + 1)
        values = scale * np.linspace(2, 1, len(x))
        values[0] = np.nan if i == 0 else values[0]
        yield Curve(
            label, x, values, 3 * values, np.array(mark, dtype=float), scale, np.nan if i == 0 else scale
        )


@pytest.fixture(params=[True, False], ids=["limit", "sd"])
def figure(request):
    angles = list(curves(range(30, 71, 5), [60, 60, 80]))
    return draw_plan("Al, $550$ nm", angles, list(curves([2, 6, 12, 24], [12])), limit=request.param)


def test_every_axis_has_its_unit_and_no_text_is_cut_or_covered(figure):
    top, bottom = figure.axes[0], figure.axes[2]
    assert top.get_ylabel() == "σ of η (1)"
    assert bottom.get_ylabel() in ("σ of k (1)", "95 % limit of k (1)")
    assert bottom.get_xlabel().endswith("(deg)")
    assert figure.axes[3].get_xlabel().endswith("(number)")
    figure.draw_without_rendering()
    texts = [*figure.texts, *figure.legends[0].get_texts()]
    for ax in figure.axes:
        assert ax.get_yscale() == "log"
        texts += [ax.xaxis.label, ax.yaxis.label]
        texts += [
            t for t in ax.get_yticklabels() if ax.get_ylim()[0] <= t.get_position()[1] <= ax.get_ylim()[1]
        ]
    boxes = [(t.get_text(), t.get_window_extent()) for t in texts if t.get_text() and t.get_visible()]
    for i, (text, box) in enumerate(boxes):
        assert "{" not in text
        assert box.x0 >= 0, text
        assert box.x1 <= figure.bbox.x1, text
        assert box.y0 >= 0, text
        for other, second in boxes[:i]:
            assert not box.overlaps(second), (text, other)


def test_each_equipment_has_its_look_and_its_marks(figure):
    left = figure.axes[0]
    marks = [line for line in left.lines if line.get_marker() not in ("None", "")]
    assert [list(line.get_xdata()) for line in marks] == [[60.0, 80.0]] * 3
    assert (
        len({line.get_marker() for line in marks}) == len({to_hex(line.get_color()) for line in marks}) == 3
    )
    # A k that is not to be told has no mark.
    assert len([line for line in figure.axes[2].lines if line.get_marker() not in ("None", "")]) == 2
    # Rows share their scale.
    assert left.get_ylim() == figure.axes[1].get_ylim()


def test_it_is_written_as_png_and_svg_and_leaves_nothing_open(figure, tmp_path):
    paths = save(figure, tmp_path, "plan")
    assert [p.name for p in paths] == ["plan.png", "plan.svg"]
    assert all(p.stat().st_size > 5000 for p in paths)
    assert not Gcf.get_all_fig_managers()
