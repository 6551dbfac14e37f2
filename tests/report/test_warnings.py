"""What a report says of a fit: every warning on either side of its threshold."""

from types import SimpleNamespace

import numpy as np
import pytest

from reflectance_fit.examination import Band, Drift, Examination, Film, Health
from reflectance_fit.report.warnings import of_the_sample, warnings_of
from reflectance_fit.result import Interval


class Fit(SimpleNamespace):
    """As much of a fit as is looked at; sound in every respect."""

    def __init__(self, **changes):
        draws = changes.pop("draws", {})
        super().__init__(
            **{
                "p_value": 0.4,
                "saturated": 0,
                "estimated_sigma": {},
                "refused_outliers": 0,
                "wavelength_nm": 610.0,
                "optimum": SimpleNamespace(reduced_chi2=1.0, eta=0.24, k=2.9),
                "posterior": SimpleNamespace(
                    converged=True, chains=None, samples=draws, flat=lambda name: draws[name]
                ),
                "observations": SimpleNamespace(
                    theta_deg=np.array([40.0, 70.0]), value=np.array([0.5, 200.0])
                ),
                "intervals": {
                    "brewster_deg": Interval(56.0, 0.1, None, None, "identified"),
                    "eta": Interval(0.24, 0.01, None, None, "identified"),
                    "k": Interval(2.9, 0.02, None, None, "identified"),
                },
            }
            | changes
        )


def found(fit=None, **seen):
    return [(note.code, note.message) for note in warnings_of(fit or Fit(), Examination(**seen))]


def test_outliers_that_go_together_leave_no_sigma_to_estimate():
    estimated = Fit(estimated_sigma={"signal_s": 0.3}, refused_outliers=12)
    assert [code for code, _ in found(estimated)] == ["SIGMA_ESTIMATED", "WRONG_MODEL"]
    assert "12 rows stand out" in found(estimated)[1][1]
    # A stated sigma has its chi2; and the runs say it already.
    assert found(Fit(refused_outliers=12)) == []
    assert [code for code, _ in found(estimated, missing_runs=5.0)] == ["SIGMA_ESTIMATED", "WRONG_MODEL"]


def test_nothing_is_said_of_a_sound_fit():
    assert found() == []


def test_each_check_of_the_fit_itself():
    assert [code for code, _ in found(Fit(p_value=0.0009))] == ["WRONG_MODEL"]
    assert found(Fit(p_value=0.0011)) == []
    assert found(Fit(saturated=2))[0] == ("SATURATED", "2 saturated rows count as lower bounds only")
    assert "signal_s 0.3" in found(Fit(estimated_sigma={"signal_s": 0.3}))[0][1]
    for angle, expected in ((34.0, ["ANGLE_RANGE"]), (36.0, []), (74.0, []), (76.0, ["ANGLE_RANGE"])):
        intervals = Fit().intervals | {"brewster_deg": Interval(angle, 0.1, None, None, "identified")}
        assert [code for code, _ in found(Fit(intervals=intervals))] == expected


@pytest.mark.parametrize(("offset", "flagged"), [(3.8, False), (4.2, True), (-4.2, True)])
def test_a_dark_level_that_is_certainly_not_zero(offset, flagged):
    draws = np.array([-1.0, 1.0]) + offset  # mean and standard deviation: offset and 1
    messages = found(Fit(draws={"dark_offset": draws}))
    assert [code for code, _ in messages] == ["DARK_OFFSET"] * flagged
    if flagged:
        assert "2.1 % of the largest" in messages[0][1]


@pytest.mark.parametrize(("z", "flagged"), [(3.9, False), (4.1, True), (-4.1, True)])
def test_the_scale_is_at_fault_not_the_material(z, flagged):
    messages = found(health=(Health("rp_equals_rs_squared", 45.0, 0.1, 0.09, z),))
    assert [code for code, _ in messages] == ["WRONG_MODEL"] * flagged
    if flagged:
        assert ("above" if z > 0 else "below") in messages[0][1]
        assert "calibration or stray light" in messages[0][1]


def test_residuals_that_bend():
    assert found(missing_runs=3.9) == []
    assert [code for code, _ in found(missing_runs=4.1)] == ["WRONG_MODEL"]


def test_a_film_with_its_thickness_and_a_drift_without():
    film, drift = Film("Si", 1.46, 2.04, 5.0, 4.0, 900.0), Drift(0.02, -0.1, 1e-5)
    ((code, message),) = found(film=film, drift=drift)
    assert code == "FILM_SUSPECTED"
    assert "2.0 nm of an oxide (n = 1.46) on tabulated Si would look the same" in message
    ((code, message),) = found(drift=drift)
    assert code == "FILM_SUSPECTED"
    assert "eta +0.02, k -0.1" in message


def test_a_band_is_wide_where_it_moves_the_index_by_more_than_is_known():
    assert found(band=Band("Au", True, 90.0, 0.009, 0.019)) == []
    ((code, message),) = found(band=Band("Au", True, 90.0, 0.009, -0.28))
    assert code == "WIDE_BAND"
    assert "over 90 nm Au would be fitted k -0.28 (sd 0.02)" in message
    assert "eta" not in message.split("would be fitted")[1].split("away")[0]
    ((_, message),) = found(band=Band("Cu", False, 90.0, 0.02, -0.28))
    assert "Cu, the nearest built-in material, would be fitted eta +0.02 (sd 0.01) and k -0.28" in message


@pytest.mark.parametrize(
    ("rejected", "said"),
    [
        ([True, True], False),  # too few to tell a sample from a wavelength
        ([True, False, False], False),
        ([True, True, False], True),
        ([True] * 10 + [False] * 10, True),
        ([True] * 9 + [False] * 11, False),
    ],
)
def test_one_interface_at_a_few_wavelengths_only_is_a_coincidence(rejected, said):
    note = of_the_sample(rejected)
    assert (note is not None) == said
    if note:
        assert note.code == "WRONG_MODEL"
        assert f"not at {sum(rejected)} of the sample's {len(rejected)}" in note.message
