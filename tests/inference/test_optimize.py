"""The optimiser: known minima, NaN walls, ranges, and the truth of noise-free data."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import minimum_filter

from reflectance_fit.inference import models, optimize, search
from reflectance_fit.inference.least_squares import least_squares
from reflectance_fit.inference.rows import gain_names, pack
from reflectance_fit.observations import concatenate
from reflectance_fit.physics.ellipsometry import psi_delta
from reflectance_fit.physics.fresnel import reflectances


def rosenbrock(x):
    return float((1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2)


def test_local_finds_a_known_minimum():
    found = optimize.minimise(
        rosenbrock, np.array([-1.2, 1.0]), np.array([[-3.0, 3.0]] * 2), np.array([0.3, 0.3])
    )
    assert found.x == pytest.approx([1.0, 1.0], abs=1e-3)
    assert found.nan_count == 0


def test_one_dimension_works_too():
    found = optimize.minimise(
        lambda x: float((x[0] - 0.3) ** 2), np.array([2.0]), np.array([[-1.0, 3.0]]), np.array([0.5])
    )
    assert found.x == pytest.approx([0.3], abs=1e-4)


def test_nan_is_counted_and_the_best_finite_point_wins():
    """nlopt alone reports success at a point next to the wall (stevengj/nlopt#279)."""

    def walled(x):
        return float((x[0] - 0.3) ** 2 + (x[1] - 0.1) ** 2) if x[0] <= 0.25 else np.nan

    found = optimize.minimise(walled, np.array([0.0, 0.0]), np.array([[-1.0, 1.0]] * 2), np.array([0.2, 0.2]))
    assert found.nan_count > 0
    assert np.isfinite(found.objective)
    assert found.objective == walled(found.x)
    assert found.x[0] <= 0.25
    nowhere = optimize.minimise(
        lambda x: np.nan, np.zeros(2), np.array([[-1.0, 1.0]] * 2), np.array([0.2, 0.2])
    )
    assert nowhere.objective == np.inf


def test_no_point_beyond_a_bound_is_tried_however_steps_are_scaled():
    """nlopt's BOBYQA comes back from scaled coordinates to 20 + 4e-15, and then refuses it as its next start."""
    ranges = np.array([[-3.0, 2.3], [0.0, 20.0]])
    generator = np.random.default_rng(5)
    beyond = 0
    for step in generator.uniform(0.01, 0.5, (40, 2)):

        def rising_to_the_bound(x):
            nonlocal beyond
            beyond += int(np.any((x < ranges[:, 0]) | (x > ranges[:, 1])))
            return float((x[0] - 0.3) ** 2 - x[1])

        found = optimize.minimise(rising_to_the_bound, np.array([0.0, 19.0]), ranges, step)
        assert found.x == pytest.approx([0.3, 20.0], abs=1e-4)
        assert found.converged
    assert beyond == 0


@pytest.mark.parametrize("step", [1.0, 100.0])
def test_a_first_step_wider_than_the_range_is_cut(step):
    """nlopt's BOBYQA refuses it."""
    found = optimize.minimise(
        lambda x: float((x[0] - 0.3) ** 2 + 10 * (x[1] + 0.2) ** 2),
        np.array([0.9, 0.9]),
        np.array([[-1.0, 1.0]] * 2),
        np.full(2, step),
    )
    assert found.x == pytest.approx([0.3, -0.2], abs=1e-3)
    assert found.converged


def test_grid_minima_are_those_of_a_minimum_filter():
    """scipy's filter over 3 x 3 places, infinite beyond the edge; the six lowest, in order."""
    generator = np.random.default_rng(3)
    for shape in [(13, 9), (1, 40), (40, 1), (2, 2)] * 20:
        values = generator.choice([*np.linspace(0, 1, 30), np.nan, np.inf], size=shape)
        filled = np.where(np.isfinite(values), values, np.inf)
        lowest = filled == minimum_filter(filled, size=3, mode="constant", cval=np.inf)
        expected = np.flatnonzero(lowest & np.isfinite(filled))
        expected = expected[np.argsort(filled.ravel()[expected], kind="stable")][:6]
        assert optimize.grid_minima(values) == expected.tolist()
        if 1 in shape:
            assert optimize.grid_minima(values.ravel()) == expected.tolist()


def test_grid_minima_are_all_and_only_the_local_ones():
    x = np.linspace(0, 4 * np.pi, 400)
    values = np.cos(x) + 0.01 * x
    assert [round(float(x[i]) / np.pi) for i in optimize.grid_minima(values)] == [1, 3]
    values[::7] = np.nan
    assert all(np.isfinite(values[i]) for i in optimize.grid_minima(values))
    plane = np.add.outer(np.cos(x), np.cos(x))
    assert len(optimize.grid_minima(plane)) == 4


GOLD = np.array([[-2.0, 2.0]] * 2)


def two_wells(x):
    """The lower well is at (-1.01, 0.3), and a local search from the right ends in the other one."""
    return float((x[0] ** 2 - 1) ** 2 + 0.1 * x[0] + (x[1] - 0.3) ** 2)


def slope_of_two_wells(x):
    return np.array([4 * x[0] * (x[0] ** 2 - 1) + 0.1, 2 * (x[1] - 0.3)])


@pytest.mark.parametrize("method", optimize.METHODS)
def test_every_rung_ends_in_a_minimum_and_the_global_ones_in_the_lowest(method):
    start = np.array([1.5, -1.0])
    found = optimize.minimise(two_wells, start, GOLD, np.array([0.2, 0.2]), method, slope_of_two_wells)
    assert slope_of_two_wells(found.x) == pytest.approx([0.0, 0.0], abs=1e-4)
    assert found.converged
    assert (found.x[0] < 0) == (method in ("direct", "crs", "mlsl"))


@pytest.mark.parametrize("method", optimize.METHODS)
def test_no_rung_takes_a_wall_for_a_minimum(method):
    """The true minimum lies behind the wall; whatever is best on this side of it is no minimum."""

    def walled(x):
        return two_wells(x) if x[0] + 0.3 * x[1] > -0.5 and x[0] < 0.7 else np.nan

    found = optimize.minimise(
        walled, np.array([0.5, 0.5]), GOLD, np.array([0.2, 0.2]), method, slope_of_two_wells
    )
    assert found.nan_count > 0
    assert found.objective == walled(found.x)
    assert not found.converged


def test_slsqp_asks_for_the_gradient():
    with pytest.raises(ValueError, match="gradient"):
        optimize.minimise(two_wells, np.zeros(2), GOLD, np.full(2, 0.1), "slsqp")


def test_least_squares_to_the_last_digits():
    """A parameter of 1e-6 beside one of 1e6, without a Jacobian; the same inside bounds, and on one."""
    t = np.linspace(0.0, 3.0, 30)
    truth = np.array([2e6, 3e-6])

    def residuals(b):
        return b[0] * np.exp(-t) + b[1] * 1e12 * t**2 - (truth[0] * np.exp(-t) + truth[1] * 1e12 * t**2)

    for bounds in (None, (np.zeros(2), np.array([1e7, 1.0]))):
        found = least_squares(residuals, np.array([1e5, 1e-5]), bounds)
        assert found.converged
        assert found.x == pytest.approx(truth, rel=1e-12)
    held = least_squares(residuals, np.array([1e5, 1e-5]), (np.zeros(2), np.array([1e6, 1.0])))
    assert held.x[0] == pytest.approx(1e6, rel=1e-6)


def test_least_squares_counts_nan():
    found = least_squares(lambda b: np.sqrt(b) - np.array([0.0, 2.0]), np.array([1.0, 9.0]))
    assert found.x[1] == pytest.approx(4.0)
    assert found.nan_count >= 0
    walled = least_squares(lambda b: np.full(3, np.nan), np.array([1.0, 2.0]))
    assert walled.nan_count > 0
    assert not walled.converged


def noise_free(rows_of, eta, k, kind):
    if kind == "ellipsometer":
        theta = np.array([60.0, 65.0, 70.0, 75.0])
        psi, delta = np.degrees(psi_delta(np.cos(np.radians(theta)), eta, k))
        return concatenate(
            [rows_of(theta, "psi_deg", psi, sigma=0.02), rows_of(theta, "delta_deg", delta, sigma=0.05)]
        )
    theta = np.arange(20.0, 85.0, 5.0)
    r = reflectances(np.cos(np.radians(theta)), eta, k)
    return concatenate(
        [
            rows_of(theta, "signal_s", 70 * r.s, sigma=0.1, gain_group="a"),
            rows_of(theta, "signal_p", 90 * r.p, sigma=0.1, gain_group="b"),
        ]
    )


@pytest.mark.parametrize(
    ("eta", "k", "kind"),
    [
        (1.33, 0.0, "goniometer"),
        (1.515, 0.0, "goniometer"),
        (2.417, 0.0, "goniometer"),
        (0.7, 0.0, "goniometer"),
        (1.5, 0.5, "goniometer"),
        (3.1, 3.3, "goniometer"),
        (0.18, 3.43, "ellipsometer"),
        (1.37, 7.62, "ellipsometer"),
        (3.88, 0.019, "ellipsometer"),
        (1.52, 0.0, "ellipsometer"),
    ],
)
def test_noise_free_data_give_the_truth(rows_of, priors, eta, k, kind):
    """Both models, whatever basin the grid starts from; k = 0 is a boundary, so k to its square root."""
    o = noise_free(rows_of, eta, k, kind)
    rows = pack(o, 1.0)
    for name in ("conductor",) if k else ("dielectric", "conductor"):
        model = models.build(name, rows, priors, {}, [])
        optimum, basins = search.find(model, rows, gain_names(o))
        assert optimum.eta == pytest.approx(eta, rel=1e-6)
        assert optimum.k == pytest.approx(k, abs=1e-6 if k else 2e-3)
        assert optimum.chi2 == pytest.approx(0.0, abs=1e-8)
        assert basins[0].objective <= basins[-1].objective
        assert optimum.dof == len(o) - len(model.names) - len(optimum.gains)


@pytest.mark.parametrize("offset_deg", [0.2, -0.2])
def test_readings_good_to_a_ten_thousandth_are_fitted_on_the_right_side_of_brewsters_angle(
    rows_of, priors, offset_deg
):
    """Two tilts behind four analyzers, angles with errors: the wrong side is a basin that descents stay in."""
    for eta in np.linspace(1.3, 2.0, 36):
        tilts = []
        for theta, roll in ((39.755, -0.488), (54.853, 0.22)):
            analyzer = np.array([0.0, 45.0, 90.0, 135.0]) + roll
            phi = np.radians(analyzer + offset_deg)
            r = reflectances(np.cos(np.radians(theta)), eta)
            signal = 0.5 * (r.s * np.cos(phi) ** 2 + r.p * np.sin(phi) ** 2)
            seen = {"sigma": 5e-5 * np.sqrt(signal * signal.max()), "theta_sigma": 0.0026}
            tilts.append(
                rows_of(
                    np.full(4, theta), "signal", signal, gain_group=f"{theta}", analyzer_deg=analyzer, **seen
                )
            )
        o = concatenate(tilts)
        rows = pack(o, 1.0)
        known = {"angle_offset_deg": 0.0017, "analyzer_offset_deg": 1.0}
        optimum, _ = search.find(models.build("dielectric", rows, priors, known, []), rows, gain_names(o))
        # The offset of the analyzer costs (0.2 / 1)^2.
        assert optimum.chi2 == pytest.approx(0.04, abs=0.01)
        assert optimum.eta == pytest.approx(eta, abs=1e-4)


def test_a_normal_prior_counts_as_a_datum(rows_of, priors):
    o = noise_free(rows_of, 1.5, 0.0, "goniometer")
    rows = pack(o, 1.0)
    model = models.build("dielectric", rows, priors, {"angle_offset_deg": 0.5}, [])
    optimum, _ = search.find(model, rows, gain_names(o))
    assert optimum.dof == len(o) + 1 - (2 + 2)
    assert optimum.parameters["angle_offset_deg"] == pytest.approx(0.0, abs=1e-5)
