"""The built-in materials: complete, physical, and equal to published values."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.materials import library

CONSTANTS = files("reflectance_fit.materials") / "constants"


def test_the_index_lists_exactly_the_files():
    listed = [entry.file for entry in library.entries().values()]
    assert sorted(listed) == sorted(path.name for path in CONSTANTS.iterdir())


def test_no_name_or_alias_means_two_materials():
    words = [word for entry in library.entries().values() for word in (entry.name, *entry.aliases)]
    keys = [library._key(word) for word in words]
    assert sorted(set(keys)) == sorted(keys)
    assert all(word == word.lower() for entry in library.entries().values() for word in entry.aliases)


@pytest.mark.parametrize("name", library.names())
def test_every_material_is_physical_over_its_whole_range(name):
    constants = library.get(name)
    wavelengths_nm = np.geomspace(*constants.range_nm, 2000)
    eta, k = constants.index(wavelengths_nm)
    assert np.all((eta > 0) & np.isfinite(eta))
    assert np.all((k >= 0) & np.isfinite(k))
    assert constants.source
    assert not set("<>") & set(constants.source)


@pytest.mark.parametrize("name", library.names())
def test_every_material_covers_green_light_or_says_why_not(name):
    low, high = library.get(name).range_nm
    assert low <= 550 <= high or "550 nm is not covered" in library.entry(name).note


@pytest.mark.parametrize("name", library.names())
def test_conductors_have_k_and_dielectrics_are_transparent_in_the_visible(name):
    constants, kind = library.get(name), library.entry(name).kind
    low, high = constants.range_nm
    _, k = constants.index(np.clip([500.0, 600.0, 700.0], low, high))
    if kind == "dielectric":
        assert np.all(k < 1e-5)
    else:
        assert constants.k_known
        assert np.all(k > (1 if kind == "metal" else 0.01))


# eta and k as tabulated; the tolerance is half the last digit of the source, unless said otherwise.
@pytest.mark.parametrize(
    ("name", "wavelength_nm", "eta", "k", "tolerance"),
    [
        pytest.param("N-BK7", 587.5618, 1.51680, None, 5e-6, id="Schott data sheet, n_d"),
        pytest.param("N-BK7", 632.8, 1.515089, None, 5e-7, id="Schott data sheet, n_632.8 = 1.51509"),
        pytest.param("SF11", 587.5618, 1.78472, None, 5e-6, id="Schott, n_d of SF11"),
        pytest.param("N-SF11", 587.5618, 1.78472, None, 5e-6, id="Schott, n_d of N-SF11"),
        pytest.param("N-LASF9", 587.5618, 1.85025, None, 5e-6, id="Schott, n_d of N-LASF9"),
        pytest.param("fused silica", 587.6, 1.45846, None, 5e-6, id="Malitson 1965, table 1"),
        pytest.param("sapphire", 587.56, 1.7682, None, 5e-5, id="Malitson and Dodge, ordinary"),
        pytest.param("diamond", 589.3, 2.4173, None, 1e-4, id="Peter 1923, n_D"),
        pytest.param("CaF2", 589.3, 1.43384, None, 5e-5, id="Malitson 1963, n_D"),
        pytest.param("NaCl", 589.3, 1.54412, None, 5e-5, id="n_D 1.54427 at 20 C, -3.7e-5 per kelvin"),
        pytest.param("quartz", 589.3, 1.54424, None, 5e-5, id="ordinary n_D of the CRC Handbook"),
        pytest.param("polystyrene", 587.6, 1.592, None, 5e-4, id="Sultanova 2009, n_d"),
        pytest.param("PMMA", 587.6, 1.491, None, 5e-4, id="Sultanova 2009, n_d"),
        pytest.param("polycarbonate", 587.6, 1.585, None, 5e-4, id="Sultanova 2009, n_d"),
        pytest.param("Au", 616.8, 0.21, 3.272, 5e-4, id="Johnson and Christy 1972, 2.01 eV"),
        pytest.param("Ag", 616.8, 0.06, 4.152, 5e-4, id="Johnson and Christy 1972, 2.01 eV"),
    ],
)
def test_published_values(name, wavelength_nm, eta, k, tolerance):
    found_eta, found_k = library.get(name).index(wavelength_nm)
    assert found_eta == pytest.approx(eta, abs=tolerance)
    if k is not None:
        assert found_k == pytest.approx(k, abs=tolerance)


def test_glass_is_relative_to_air_and_water_to_vacuum():
    """Water: n_D = 1.33299 relative to air of 20 C (Tilton and Taylor 1938), whose index is 1.000272."""
    assert library.get("N-BK7").absolute_index(632.8)[0] == pytest.approx(1.51551, abs=5e-6)
    water = library.get("water")
    assert water.absolute_index(589.3)[0] == pytest.approx(1.33299 * 1.000272, abs=1e-5)


@pytest.mark.parametrize(
    ("asked", "name"),
    [
        ("n-bk7", "N-BK7"),
        ("BK7", "N-BK7"),
        ("H-K9L", "N-BK7"),
        ("Fused_Silica", "fused silica"),
        ("soda lime", "soda-lime"),
        ("AU", "Au"),
        ("aluminum", "Al"),
        ("aluminium", "Al"),
        ("Perspex", "PMMA"),
        ("tungsten", "W"),
    ],
)
def test_names_in_any_case_and_aliases(asked, name):
    assert library.get(asked).name == name
    assert library.get(asked) is library.get(name)


@pytest.mark.parametrize(
    ("asked", "message"),
    [("N-BK8", "no built-in material 'N-BK8', did you mean 'N-BK7'?"), ("GOLDD", "did you mean 'gold'?")],
)
def test_an_unknown_name_gets_a_suggestion(asked, message):
    with pytest.raises(ReflectanceFitError) as caught:
        library.get(asked)
    assert message in str(caught.value)


def test_a_name_like_nothing_points_to_the_list():
    with pytest.raises(ReflectanceFitError, match="materials list"):
        library.get("xyzzyx")


@pytest.mark.parametrize(
    ("sample", "name"),
    [
        ("K9 prism", "N-BK7"),
        ("K 9 prism", "N-BK7"),
        ("H-K9L plate", "N-BK7"),
        ("BK7 flat", "N-BK7"),
        ("BK-7", "N-BK7"),
        ("gold mirror", "Au"),
        ("GOLD_mirror", "Au"),
        ("flat_gold", "Au"),
        ("Au on a wafer", "Au"),
        ("Ag", "Ag"),
        ("N-SF11 prism", "N-SF11"),
        ("SF11 prism", "SF11"),
        ("TiO2 coating", "TiO2 film"),
        ("quartz glass", "fused silica"),
        ("rock salt, NaCl", "NaCl"),
        ("sodium chloride", "NaCl"),
        ("a Plexiglass sheet", "PMMA"),
        ("Ta_060810", "Ta"),
        ("stainless-steel", "stainless steel"),
        ("gold slide", "Au"),
        ("image", None),
        ("AG", None),
        ("ag", None),
        ("Agate", None),
        ("martini", None),
        ("glass", None),
        ("a glass prism", None),
        ("SF111", None),
        ("silicone", None),
        ("silicon carbide", None),
        ("iron oxide", None),
        ("gold on silicon", None),
        ("SiO2 film on Si", None),
        ("", None),
    ],
)
def test_match_finds_whole_words_only(sample, name):
    found = library.match(sample)
    assert (found.name if found else None) == name


def test_spreads_keep_the_surveyed_order():
    """Tables of glass agree to a thousandth, of silver's eta hardly at all."""
    spread = {name: library.entry(name).spread for name in library.names()}
    assert spread["N-BK7"] == 0.002
    assert 0.1 <= spread["Au"] <= 0.5
    assert 0.8 <= spread["Ag"] <= 0.95
    assert all(0.001 <= value <= 1.5 for value in spread.values())


def test_tantalum_spreads_as_far_as_the_two_measurements_differ():
    """Ellipsometry of a film: 2.398 + 3.175i at 550 nm; the table comes from electron energy loss."""
    eta, _ = library.get("Ta").index(550)
    assert abs(2.398 - eta) <= library.entry("Ta").spread * eta
