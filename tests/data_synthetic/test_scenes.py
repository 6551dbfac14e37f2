"""Scenes against Fresnel's equations and against what a picture must look like when the rig is turned."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.data_synthetic.scenes import FlatScene, SphereScene, analyzer_weights
from reflectance_fit.materials.loader import AIR_INDEX
from reflectance_fit.physics.fresnel import amplitudes, reflectances
from reflectance_fit.physics.stokes import circular, linear, unpolarized

GLASS, GOLD = (1.519, 0.0), (0.424, 2.472)
OUTLINE = (4, 6, 12, 10)
DEGREES = st.floats(-180.0, 180.0)
MATERIAL = st.sampled_from([GLASS, GOLD])


def seen(scene, material, analyzer_deg, x=8, y=8, **optics):
    return scene.stokes(x, y, *material) @ analyzer_weights(analyzer_deg, **optics)


def relative(theta_deg, material):
    eta, k = material
    return reflectances(np.cos(np.radians(theta_deg)), eta / AIR_INDEX, k / AIR_INDEX)


def fields(theta_deg, material):
    eta, k = material
    return amplitudes(np.cos(np.radians(theta_deg)), eta / AIR_INDEX, k / AIR_INDEX)


@given(theta_deg=st.floats(0.0, 89.0), s_axis_deg=DEGREES, material=MATERIAL)
def test_analyzer_along_s_and_p_sees_the_two_reflectances(theta_deg, s_axis_deg, material):
    scene = FlatScene(OUTLINE, theta_deg, unpolarized(), s_axis_deg)
    powers = relative(theta_deg, material)
    assert seen(scene, material, s_axis_deg) == pytest.approx(powers.s / 2, abs=1e-12)
    assert seen(scene, material, s_axis_deg + 90) == pytest.approx(powers.p / 2, abs=1e-12)
    # A leaky analyzer lets some of the other pass.
    leaky = seen(scene, material, s_axis_deg, diattenuation=0.9)
    assert leaky == pytest.approx((0.95 * powers.s + 0.05 * powers.p) / 2, abs=1e-12)


@given(axis_deg=DEGREES, analyzer_deg=DEGREES)
def test_malus(axis_deg, analyzer_deg):
    signal = linear(np.radians(axis_deg)) @ analyzer_weights(analyzer_deg)
    assert signal == pytest.approx(np.cos(np.radians(axis_deg - analyzer_deg)) ** 2, abs=1e-12)


@given(turn_deg=DEGREES, analyzer_deg=DEGREES, plate_deg=DEGREES, material=MATERIAL)
def test_a_turned_rig_is_an_analyzer_turned_the_other_way(turn_deg, analyzer_deg, plate_deg, material):
    upright = FlatScene(OUTLINE, 66.0, linear(np.radians(45)))
    turned = FlatScene(OUTLINE, 66.0, linear(np.radians(45)), turn_deg)
    expected = seen(upright, material, analyzer_deg - turn_deg, retarder_deg=plate_deg - turn_deg)
    assert seen(turned, material, analyzer_deg, retarder_deg=plate_deg) == pytest.approx(expected, abs=1e-12)


def test_angles_run_counter_clockwise_as_displayed():
    """s up and to the right of the displayed picture: an analyzer at +45 passes it, one at -45 stops it."""
    brewster = np.degrees(np.arctan(GLASS[0] / AIR_INDEX))
    flat = FlatScene(OUTLINE, brewster, unpolarized(), s_axis_deg=45.0)
    assert seen(flat, GLASS, 45) > 0.05
    assert seen(flat, GLASS, -45) == pytest.approx(0.0, abs=1e-12)
    # On the ball s runs along the tangent, which points that way at the top left (small x and y).
    ball = SphereScene((100.0, 100.0), 80.0, unpolarized())
    step = 80 * np.sin(np.radians(brewster)) / np.sqrt(2)
    assert seen(ball, GLASS, 45, 100 - step, 100 - step) > 0.05
    assert seen(ball, GLASS, -45, 100 - step, 100 - step) == pytest.approx(0.0, abs=1e-12)


def test_a_plate_shows_the_handedness_of_gold():
    """+45 degree light comes off gold right-handed; over a quarter wave that is more at +45 than at -45."""
    scene = FlatScene(OUTLINE, 70.0, linear(np.pi / 4))
    r_s, r_p = fields(70.0, GOLD)
    s3 = 2 * (r_s * np.conj(r_p)).imag / 2
    assert s3 > 0
    plate = {"retarder_deg": 0.0, "retardance_deg": 90.0}
    assert seen(scene, GOLD, 45, **plate) - seen(scene, GOLD, 135, **plate) == pytest.approx(s3)


def test_the_sample_fills_its_outline():
    scene = FlatScene(OUTLINE, 50.0, unpolarized(), stray=0.25)
    s0 = scene.stokes(np.arange(16), np.arange(16)[:, None], *GLASS)[..., 0]
    inside = np.zeros((16, 16), dtype=bool)
    inside[6:10, 4:12] = True
    assert s0[inside] == pytest.approx(relative(50.0, GLASS).mean)
    assert s0[~inside] == pytest.approx(0.25)


@given(theta_deg=st.floats(0.0, 85.0), around_deg=DEGREES, material=MATERIAL)
def test_a_ring_of_the_ball_is_one_angle_of_incidence(theta_deg, around_deg, material):
    r, around = 300 * np.sin(np.radians(theta_deg)), np.radians(around_deg)
    scene = SphereScene((400.0, 350.0), 300.0, unpolarized())
    s0, s1, s2, s3 = scene.stokes(400 + r * np.cos(around), 350 - r * np.sin(around), *material)
    powers = relative(theta_deg, material)
    assert s0 == pytest.approx(powers.mean, rel=1e-9)
    # Polarized along the tangent, at a right angle to the radius.
    part = (powers.s - powers.p) / 2
    tangent = 2 * (around + np.pi / 2)
    assert [s1, s2, s3] == pytest.approx([part * np.cos(tangent), part * np.sin(tangent), 0.0], abs=1e-9)


@given(theta_deg=st.floats(1.0, 85.0), around_deg=DEGREES)
def test_circular_light_looks_alike_from_all_sides(theta_deg, around_deg):
    r, around = 300 * np.sin(np.radians(theta_deg)), np.radians(around_deg)
    r_s, r_p = fields(theta_deg, GOLD)
    cross = r_s * np.conj(r_p)
    for hand, sign in (("right", 1), ("left", -1)):
        scene = SphereScene((0.0, 0.0), 300.0, circular(hand))
        s0, s1, s2, s3 = scene.stokes(r * np.cos(around), -r * np.sin(around), *GOLD)
        # Seen in the frame of the tangent, nothing depends on where around the ring it is.
        local = (s1 + 1j * s2) * np.exp(-2j * (around + np.pi / 2))
        powers = relative(theta_deg, GOLD)
        assert s0 == pytest.approx(powers.mean, rel=1e-9)
        assert local == pytest.approx((powers.s - powers.p) / 2 - 1j * sign * cross.imag, abs=1e-9)
        assert s3 == pytest.approx(sign * cross.real, abs=1e-9)


def test_the_rim_meets_the_surround_without_a_step():
    scene = SphereScene((50.0, 50.0), 30.0, circular("left"))
    across = scene.stokes([60.0, 79.0, 80.0 - 1e-9, 80.0, 90.0], 50.0, *GLASS)
    assert np.all(np.diff(across[:3, 0]) > 0)
    assert across[2] == pytest.approx(circular("left"), abs=1e-4)
    assert across[3:] == pytest.approx(np.array([circular("left")] * 2))


def test_a_surround_cannot_be_linear():
    with pytest.raises(ValueError, match="unpolarized or circular"):
        SphereScene((0.0, 0.0), 1.0, linear(0.3))
