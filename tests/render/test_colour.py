"""Spectra keep their colour on the way through the transport: white is white, triples come back, tables are read where they should be."""

import colour
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.render.colour import (
    GRID_NM,
    LUMINANCE,
    Curves,
    basis,
    emission,
    index,
    integral,
    observer,
    reflectance,
    wavelength_quantiles,
)
from reflectance_fit.render.scene import Spectrum, constant

CHANNELS = (600.0, 550.0, 450.0)
UNIT = st.floats(0.0, 1.0)
TRIPLES = st.tuples(UNIT, UNIT, UNIT).map(np.array)


def seen(curve, light=None):
    """Linear sRGB of a curve, by quadrature over 1e6 points: not by the module's own."""
    at = np.linspace(360, 830, 1_000_001)
    spectrum = np.interp(at, GRID_NM, curve) * (1 if light is None else np.interp(at, GRID_NM, light))
    return np.array([np.trapezoid(np.interp(at, GRID_NM, row) * spectrum, at) for row in observer().rgb])


def table(wavelength_nm, values):
    return Spectrum(np.asarray(values, dtype=float), np.asarray(wavelength_nm, dtype=float))


@given(TRIPLES)
def test_a_triple_is_a_physical_reflectance_of_its_own_colour(rgb):
    curve = reflectance(Spectrum(rgb), "spectral", CHANNELS)
    assert np.all((curve >= 0) & (curve <= 1 + 1e-12))
    found = [integral(row, curve, observer().white) for row in observer().rgb]
    assert found == pytest.approx(rgb, abs=1e-12)


def test_the_exact_integral_is_the_fine_sum():
    rgb = np.array([0.9, 0.3, 0.1])
    curve = reflectance(Spectrum(rgb), "spectral", CHANNELS)
    assert seen(curve, observer().white) == pytest.approx(rgb, abs=1e-9)


@pytest.mark.parametrize("light", [constant(2.5), Spectrum(np.full(3, 2.5))])
def test_light_of_one_number_is_white_in_every_mode(light):
    assert seen(emission(light, "spectral", CHANNELS)) == pytest.approx(2.5, abs=1e-9)
    assert emission(light, "rgb", CHANNELS) == pytest.approx(2.5)
    assert emission(light, "polarized", CHANNELS) == pytest.approx(2.5)
    assert emission(light, "scalar", CHANNELS) == pytest.approx(2.5)


def test_coloured_light_keeps_its_triple():
    rgb = np.array([0.2, 4.0, 1.0])
    assert seen(emission(Spectrum(rgb), "spectral_polarized", CHANNELS)) == pytest.approx(rgb, abs=1e-9)
    assert emission(Spectrum(rgb), "scalar", CHANNELS) == pytest.approx(rgb @ [0.2126, 0.7152, 0.0722])


def test_a_flat_table_has_the_luminance_of_its_value_and_the_colour_of_equal_energy():
    found = seen(emission(table([400, 700], [1, 1]), "spectral", CHANNELS))
    assert found @ LUMINANCE == pytest.approx(1, abs=2e-4)
    xyz = colour.RGB_to_XYZ(found, "sRGB")
    assert xyz / xyz.sum() == pytest.approx(1 / 3, abs=1e-3)


@pytest.mark.parametrize("illuminant", ["A", "D65", "FL2"])
def test_colours_of_light_are_those_of_colour_science(illuminant):
    """Its matching functions at 1 nm and the standard matrix; FL2 has narrow lines, which must keep their area."""
    light = colour.SDS_ILLUMINANTS[illuminant]
    matching = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    values = np.interp(matching.wavelengths, light.wavelengths, light.values)
    due = colour.XYZ_to_RGB(values @ matching.values, "sRGB")
    found = seen(emission(table(light.wavelengths, light.values), "spectral", CHANNELS))
    assert found / (found @ LUMINANCE) == pytest.approx(due / (due @ LUMINANCE), abs=0.004)


@pytest.mark.parametrize("centre", [450.0, 532.1, 612.4])
def test_a_line_keeps_its_area_wherever_it_falls_between_grid_points(centre):
    line = table([centre - 0.5, centre, centre + 0.5], [0, 1, 0])
    curve = emission(line, "spectral", CHANNELS)
    assert np.trapezoid(curve, GRID_NM) == pytest.approx(0.5, rel=1e-9)
    assert np.trapezoid(curve * GRID_NM, GRID_NM) == pytest.approx(0.5 * centre, rel=1e-9)


@given(st.lists(st.floats(0, 1), min_size=2, max_size=30))
def test_averaging_a_table_stays_inside_its_values(values):
    curve = reflectance(table(np.linspace(350, 850, len(values)), values), "spectral", CHANNELS)
    assert np.all((curve >= min(values) - 1e-12) & (curve <= max(values) + 1e-12))


def test_tables_are_read_at_the_channels_and_held_beyond_their_ends():
    ramp = table([500, 600], [0.2, 0.4])
    assert reflectance(ramp, "rgb", CHANNELS) == pytest.approx([0.4, 0.3, 0.2])
    assert reflectance(ramp, "scalar", CHANNELS) == pytest.approx([0.3])
    assert index(ramp, "polarized", CHANNELS) == pytest.approx([0.4, 0.3, 0.2])
    curve = index(ramp, "spectral", CHANNELS)
    assert curve == pytest.approx(np.interp(GRID_NM, [500, 600], [0.2, 0.4]))


def test_three_indices_stand_at_the_channels_and_are_no_colour():
    gold = Spectrum(np.array([0.25, 0.4, 1.4]))
    assert index(gold, "rgb", CHANNELS) == pytest.approx([0.25, 0.4, 1.4])
    assert index(gold, "scalar", CHANNELS) == pytest.approx([0.4])
    curve = index(gold, "spectral", CHANNELS)
    assert np.interp([450, 500, 550, 600], GRID_NM, curve) == pytest.approx([1.4, 0.9, 0.4, 0.25])
    assert curve[[0, -1]] == pytest.approx([1.4, 0.25])


@pytest.mark.parametrize("mode", ["scalar", "rgb", "polarized", "spectral", "spectral_polarized"])
def test_pixels_weigh_the_basis_as_spectra_do(mode):
    rgb = np.array([0.7, 0.2, 0.5])
    assert rgb @ basis(mode) == pytest.approx(reflectance(Spectrum(rgb), mode, CHANNELS))
    assert rgb @ basis(mode, light=True) == pytest.approx(emission(Spectrum(rgb), mode, CHANNELS))


def test_equal_spectra_share_a_row():
    curves = Curves("rgb", CHANNELS)
    grey = curves.reflectance(constant(0.5))
    assert curves.reflectance(Spectrum(np.full(3, 0.5))) == grey
    assert curves.index(constant(1.5)) != grey
    assert curves.array() == pytest.approx(np.array([[0.5] * 3, [1.5] * 3]))


def test_an_empty_scene_has_no_rows():
    assert Curves("spectral", CHANNELS).array().shape == (0, 95)


@pytest.mark.parametrize(
    ("read", "spectrum", "words"),
    [
        (reflectance, constant(1.2), "at most 1"),
        (reflectance, constant(-0.1), "at 0 or above"),
        (emission, constant(np.nan), "must be finite"),
        (index, constant(np.inf), "must be finite"),
        (index, Spectrum(np.ones(2)), "one number, three"),
        (index, table([500, 400], [1, 1]), "increase"),
        (emission, table([500, 400], [1, 1, 1]), "one value for each"),
    ],
)
def test_what_is_no_spectrum_is_refused(read, spectrum, words):
    with pytest.raises(ValueError, match=words):
        read(spectrum, "rgb", CHANNELS)


def draw(u, quantiles):
    """Wavelength and one over its density, as the docstring has it."""
    cells = quantiles.size - 1
    j = np.floor(u * cells).astype(int)
    width = np.diff(quantiles)[j]
    return quantiles[j] + (u * cells - j) * width, cells * width


def test_drawn_wavelengths_weighted_by_their_density_integrate_exactly():
    quantiles = wavelength_quantiles()
    assert quantiles[[0, -1]] == pytest.approx([360, 830])
    assert np.all(np.diff(quantiles) > 0)
    at, weight = draw((np.arange(2_000_000) + 0.5) / 2_000_000, quantiles)
    for curve in (np.ones(95), *observer().rgb, observer().white):
        due = integral(curve)
        assert np.mean(np.interp(at, GRID_NM, curve) * weight) == pytest.approx(due, rel=1e-5)


def test_four_wavelengths_see_white_with_the_noise_that_is_stated():
    u = (np.arange(4000)[:, None] / 4000 + np.arange(4) / 4) % 1
    at, weight = draw(u, wavelength_quantiles())
    light = np.interp(at, GRID_NM, observer().white) * weight
    each = np.stack([np.mean(np.interp(at, GRID_NM, row) * light, axis=1) for row in observer().rgb])
    assert each.mean(axis=1) == pytest.approx(1, abs=1e-3)
    assert np.sqrt(np.mean(each.var(axis=1))) == pytest.approx(0.13, abs=0.005)
