"""Every picture draws in silence, carries units, and is the same bytes every time."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib._pylab_helpers import Gcf
from matplotlib.image import imread

from reflectance_fit.inference.predict import predictor
from reflectance_fit.plot.chains import draw_autocorrelation, draw_rank, draw_trace
from reflectance_fit.plot.corner import draw_corner
from reflectance_fit.plot.curve import Model, turn
from reflectance_fit.plot.figures import draw_all, pictures
from reflectance_fit.plot.fit import draw_fit
from reflectance_fit.plot.priors import draw_prior_posterior
from reflectance_fit.plot.residuals import draw_residuals
from reflectance_fit.plot.schlick import draw_schlick
from reflectance_fit.plot.series import panels
from reflectance_fit.plot.spectrum import draw_spectrum
from reflectance_fit.plot.style import save

FITS = ["glass", "gold", "photographs", "analyzer_scan", "everything"]
NAMES = ["fit", "residuals", "corner", "trace", "autocorrelation", "rank", "prior_posterior", "schlick"]
HOSTILE = ["_a$x_{$<script>alert(1)</script>", "re\u202edrawer\nline", "\\frac{$日本" + "x" * 500]
UNIT = re.compile(r"\((deg|fraction|ratio|a\.u\.|nm|steps|iterations|σ)\)|density|^(η|k)\b|$^")


def test_what_only_chains_have_is_drawn_for_chains_only(glass, tmp_path, predict):
    weighted = replace(
        glass, posterior=replace(glass.posterior, method="importance", chains=None, pareto_k=0.2)
    )
    paths = draw_all([weighted], tmp_path, predict)
    assert {p.stem for p in paths} == set(NAMES) - {"trace", "autocorrelation"}
    assert len(paths) == 2 * pictures([weighted])
    assert pictures([glass, weighted, glass]) == 8 + 6 + 8 + 1
    with pytest.raises(ValueError, match="importance has no chains"):
        draw_trace(weighted)


@pytest.mark.parametrize("name", FITS)
def test_every_picture_is_written_whole(name, request, tmp_path, predict):
    seen = []
    paths = draw_all([request.getfixturevalue(name)], tmp_path, predict, progress=seen.append)
    assert seen == NAMES
    assert sorted(p.name for p in paths) == sorted(p.name for p in tmp_path.iterdir())
    assert {p.name for p in paths} == {f"{n}.{kind}" for n in NAMES for kind in ("png", "svg")}
    for path in paths:
        assert 2_000 < path.stat().st_size < 500_000
        if path.suffix == ".png":
            assert imread(path)[..., :3].std() > 0.02
        else:
            ElementTree.parse(path)
    assert not Gcf.get_all_fig_managers()


def test_equal_input_gives_equal_bytes(glass, tmp_path, predict):
    first = draw_all([glass], tmp_path / "a", predict)
    second = draw_all([glass], tmp_path / "b", predict)
    for one, two in zip(first, second, strict=True):
        assert one.read_bytes() == two.read_bytes(), one.name


def test_hostile_names_stay_text(analyzer_scan, tmp_path, predict):
    def named(text):
        observations = replace(
            analyzer_scan.observations,
            set=np.array([text if i % 2 else "other" for i in range(len(analyzer_scan.observations))]),
        )
        return replace(analyzer_scan, channel=text, observations=observations)

    paths = draw_all([named(text) for text in HOSTILE], tmp_path, predict)
    assert len(set(paths)) == len(paths) == 2 * (len(NAMES) * len(HOSTILE) + 1)
    for path in paths:
        assert re.fullmatch(r"[A-Za-z0-9._-]{1,80}", path.name)
        if path.suffix == ".svg":
            text = path.read_text(encoding="utf-8")
            assert "<script" not in text
            assert "\u202e" not in text
            ElementTree.fromstring(text)


def test_many_channels_draw_three_and_the_spectrum(analyzer_scan, tmp_path, predict):
    fits = [replace(analyzer_scan, channel=f"{w} nm", wavelength_nm=float(w)) for w in range(400, 530, 10)]
    names = {p.stem for p in draw_all(fits, tmp_path, predict)}
    assert names == {f"{n}-{w}nm" for n in NAMES for w in (400, 460, 520)} | {"spectrum"}


def figures(fit, predict):
    yield draw_fit(fit, predict(fit))
    for draw in (
        draw_residuals,
        draw_corner,
        draw_trace,
        draw_autocorrelation,
        draw_rank,
        draw_prior_posterior,
    ):
        yield draw(fit)
    yield draw_schlick(fit)
    yield draw_spectrum([fit] * 3)


def numbers(ax):
    """The tick labels to be seen; slanted ones stand closer than their boxes."""
    found = []
    for axis, (low, high) in ((ax.xaxis, sorted(ax.get_xlim())), (ax.yaxis, sorted(ax.get_ylim()))):
        if ax.axison and axis.get_visible():
            labels = [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
            found += [label for label in labels if label.get_visible() and label.get_rotation() == 0]
    return found


@pytest.mark.parametrize("name", FITS)
def test_labels_carry_units_and_no_text_is_cut_or_covered(name, request, predict):
    for figure in figures(request.getfixturevalue(name), predict):
        labels = [axis.label for ax in figure.axes for axis in (ax.xaxis, ax.yaxis) if axis.label.get_text()]
        assert labels
        for label in labels:
            assert UNIT.search(label.get_text().replace("\n", " ")), label
        figure.draw_without_rendering()
        texts = [*labels, *figure.texts]
        for ax in figure.axes:
            texts += [ax.title, *ax.texts, *(ax.get_legend().get_texts() if ax.get_legend() else [])]
            texts += numbers(ax)
        boxes = [(t.get_text(), t.get_window_extent()) for t in texts if t.get_text()]
        for i, (text, box) in enumerate(boxes):
            assert box.x0 >= 0, text
            assert box.y0 >= 0, text
            assert box.x1 <= figure.bbox.x1, text
            assert box.y1 <= figure.bbox.y1, text
            for other, second in boxes[:i]:
                assert not box.overlaps(second), (text, other)


def test_a_user_style_changes_nothing_and_is_left_alone(glass, tmp_path):
    import matplotlib

    plain = save(draw_rank(glass), tmp_path, "plain")
    with matplotlib.rc_context({"font.size": 30.0, "axes.facecolor": "black"}):
        loud = save(draw_rank(glass), tmp_path, "loud")
        assert matplotlib.rcParams["font.size"] == 30.0
    assert plain[0].read_bytes() == loud[0].read_bytes()


def test_a_failed_picture_leaves_nothing_behind(glass, tmp_path, monkeypatch):
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(OSError("disk")))
    with pytest.raises(OSError, match="disk"):
        save(draw_autocorrelation(glass), tmp_path, "picture")
    assert not list(tmp_path.iterdir())


def test_the_band_holds_the_curve_and_is_as_narrow_as_the_data_make_it(glass):
    """A draw's own gain, not the optimum's: else a 1 % error of eta would be 5 % of signal."""
    model = Model(glass, predictor(glass))
    (panel,) = panels(glass.observations)
    curves = model.curves(panel)
    for curve in curves:
        middle = (curve.x > 20) & (curve.x < 85)
        assert np.all(curve.band[0][middle] <= curve.best[middle] + 0.002)
        assert np.all(curve.band[3][middle] >= curve.best[middle] - 0.002)
    curve = curves[0]
    at = np.argmin(np.abs(curve.x - 60))
    assert (curve.band[3] - curve.band[0])[at] / curve.best[at] < 0.03


def test_turn_takes_the_short_way_and_keeps_half_turns():
    np.testing.assert_allclose(turn(np.array([359.0, -359.0, 180.0, -180.0, 10.0])), [-1, 1, 180, -180, 10])


def test_what_was_scanned_is_the_abscissa(analyzer_scan, photographs):
    assert [p.abscissa for p in panels(analyzer_scan.observations)] == ["analyzer_deg"]
    (panel,) = panels(photographs.observations)
    assert panel.abscissa == "theta_deg"
    assert [s.label for s in panel.series] == [f"analyzer {a}°" for a in (0, 45, 90, 135)]


def test_short_runs_and_unknown_angles_draw(gold, predict, tmp_path):
    nothing = np.array([np.nan, np.nan])
    chains = replace(gold.posterior.chains, tau_steps=np.array([50.0, 100.0]), tau=nothing)
    posterior = replace(gold.posterior, chains=chains, ess={})
    blank = replace(gold.intervals["eta"], median=None, sd=None, ci68=None, status="not_identified")
    intervals = {"eta": blank, "k": blank, "brewster_deg": blank}
    fit = replace(gold, posterior=posterior, intervals=intervals, estimated_sigma={"psi_deg": 0.3})
    for figure in (
        draw_fit(fit, predict(fit)),
        draw_residuals(fit),
        draw_autocorrelation(fit),
        draw_rank(fit),
    ):
        save(figure, tmp_path, "picture")
    save(draw_spectrum([fit] * 3), tmp_path, "spectrum")
