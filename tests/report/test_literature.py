"""The fitted index beside the table that the sample's name points to."""

from types import SimpleNamespace

import pytest

from reflectance_fit.materials.library import entry, get
from reflectance_fit.report.literature import compare
from reflectance_fit.result import Interval

BOUND = Interval(None, None, None, (0.0, 0.1), "upper_limit")


def fit(eta: float | None, sd: float | None, wavelength_nm: float = 550.0, k: Interval = BOUND):
    """As much of a fit as is looked at."""
    interval = Interval(eta, sd, None, None, "identified" if eta else "not_identified")
    return SimpleNamespace(wavelength_nm=wavelength_nm, intervals={"eta": interval, "k": k})


def table(name: str, wavelength_nm: float = 550.0) -> float:
    return float(get(name).absolute_index(wavelength_nm)[0])


def test_k9_is_bk7():
    """Schott's formula: 1.51852 in air at 550 nm, so 1.51894 relative to vacuum."""
    literature, warning = compare("K9 prism", fit(1.5195, 0.001))
    assert literature is not None
    assert literature.nearest == "N-BK7"
    assert literature.eta == pytest.approx(1.51852 * 1.000277, abs=1e-5)
    assert literature.source == "Schott 2017"
    assert literature.z == pytest.approx((1.5195 - literature.eta) / 0.001)
    assert warning is None


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_disagreement_is_flagged(sign):
    # 2 parts in 1000 is the spread among glasses sold by that name.
    spread = entry("N-BK7").spread * table("N-BK7")
    far, near = (table("N-BK7") + sign * factor * (0.001**2 + spread**2) ** 0.5 for factor in (3.05, 2.95))
    literature, warning = compare("N-BK7", fit(far, 0.001))
    assert literature is not None
    assert warning is not None
    for part in (
        f"{far:.4f}",
        "N-BK7",
        f"{table('N-BK7'):.4f}",
        "550 nm",
        f"{abs(literature.z):.1f} sd",
        "Schott",
    ):
        assert part in warning
    assert compare("N-BK7", fit(near, 0.001))[1] is None


def test_an_absorbing_glass_is_flagged():
    """Stray light on a glass is fitted as k > 0; only the table knows better."""
    k = Interval(0.18, 0.02, None, None, "identified")
    _, warning = compare("N-BK7", fit(1.519, 0.001, k=k))
    assert warning is not None
    assert "k = 0.18" in warning
    assert "stray light" in warning
    assert "stray light" not in (compare("Au", fit(table("Au"), 0.01, k=k))[1] or "")


@pytest.mark.parametrize("name", ["Au", "Al", "Si"])
def test_k_of_what_absorbs_is_compared_as_leniently_as_eta(name):
    """The spread among tables is one of the index: relative to k alone, that of silicon in red light would be nothing."""
    eta, k = (float(x) for x in get(name).absolute_index(550.0))
    spread = entry(name).spread * (eta**2 + k**2) ** 0.5
    for factor, flagged in ((2.9, False), (3.1, True)):
        found = Interval(k + factor * (spread**2 + 0.001**2) ** 0.5, 0.001, None, None, "identified")
        literature, warning = compare(name, fit(eta, 0.001, k=found))
        assert literature is not None
        assert literature.z_k == pytest.approx((found.median - k) / 0.001)
        assert (warning is not None) == flagged
        if warning:
            assert f"k = {found.median:.4f}" in warning


@pytest.mark.parametrize("name", ["my sample", "unknown glass", "", "gold on silicon", "a$x_{$b"])
def test_a_name_that_says_nothing(name):
    assert compare(name, fit(1.5, 0.001)) == (None, None)


def test_a_wavelength_that_the_table_does_not_cover():
    assert compare("N-BK7", fit(1.5, 0.001, wavelength_nm=200.0)) == (None, None)


@pytest.mark.parametrize("metal", ["Au", "Ag", "Al", "Cu"])
def test_the_spread_among_tables_of_a_metal_is_respected(metal):
    """Evaporated, polished and single-crystal metals differ by tens of per cent: z is large, yet nothing is wrong."""
    spread = entry(metal).spread
    assert spread > 0.05
    eta = table(metal) * (1 + 1.5 * spread)
    literature, warning = compare(f"{metal} mirror", fit(eta, 0.001))
    assert literature is not None
    assert abs(literature.z or 0) > 3
    assert warning is None
    assert compare(f"{metal} mirror", fit(table(metal) * (1 + 3.5 * spread), 0.001))[1] is not None


@pytest.mark.parametrize(("eta", "sd"), [(None, None), (1.5, None), (1.5, 0.0)])
def test_an_index_that_is_not_identified_agrees_with_everything(eta, sd):
    literature, warning = compare("N-BK7", fit(eta, sd))
    assert literature is not None
    assert literature.z is None
    assert warning is None
