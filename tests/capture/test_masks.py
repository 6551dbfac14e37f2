"""Nothing is masked of clean pictures; a planted dot, dust and a shining wall are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reflectance_fit.capture.masks import Rings, highlights, stray_light
from reflectance_fit.data_synthetic.scenes import FlatScene, SphereScene, analyzer_weights
from reflectance_fit.physics.stokes import unpolarized
from reflectance_fit.views import StokesMaps, stokes_maps

SIDE = 240
Y, X = np.mgrid[:SIDE, :SIDE].astype(float)
CENTRE, RADIUS = (118.3, 121.2), 110.0
AXES_DEG = (0.0, 45.0, 90.0, 135.0)
MATERIALS = {"glass": (1.52, 0.0), "gold": (0.35, 2.7), "dense": (4.1, 0.05)}


def ball(eta, k):
    right, up = X - CENTRE[0], CENTRE[1] - Y
    distance = np.hypot(right, up)
    theta = np.arcsin(np.where(distance < RADIUS, distance / RADIUS, np.nan))
    rings = Rings(theta, np.arctan2(up, right) + np.pi / 2)
    inside = (theta > np.radians(8)) & (theta < np.radians(76))
    return SphereScene(CENTRE, RADIUS, unpolarized()).stokes(X, Y, eta, k), inside, rings


def flat(eta, k):
    """A plate seen in perspective: the angle changes by five degrees over the picture."""
    stokes = np.empty((SIDE, SIDE, 4))
    for column in range(SIDE):
        scene = FlatScene((0, 0, SIDE, SIDE), 50.0 + 5.0 * column / SIDE, unpolarized(), s_axis_deg=20.0)
        stokes[:, column] = scene.stokes(X[:, column], Y[:, column], eta, k)
    return stokes, np.ones((SIDE, SIDE), dtype=bool), None


SCENES = {"ball": ball, "flat": flat}


def measured(stokes, seed, noise=0.002, texture=None):
    """What four views with shot noise give; ``noise`` is that of a cell at full signal."""
    rng = np.random.default_rng(seed)
    falloff = 1 / (1 + 0.15 * ((X - 130) ** 2 + (Y - 110) ** 2) / SIDE**2) ** 2
    views = np.stack([stokes @ analyzer_weights(axis) for axis in AXES_DEG]) * falloff
    if texture is not None:
        views = views * texture
    brightest = np.nanmax(views)
    views = views + noise * np.sqrt(brightest * np.maximum(views, 0)) * rng.standard_normal(views.shape)
    return stokes_maps(views, np.radians(AXES_DEG), 1.0)


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("material", MATERIALS)
@settings(max_examples=5, deadline=None, derandomize=True)
@given(seed=st.integers(0, 1000), noise=st.sampled_from([0.0, 0.002, 0.01]))
def test_nothing_is_masked_of_a_clean_picture(scene, material, seed, noise):
    stokes, inside, rings = SCENES[scene](*MATERIALS[material])
    maps = measured(stokes, seed, noise)
    assert not highlights(maps, inside, rings).any()
    assert not stray_light(maps, inside, rings).any()


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize(("change", "radius"), [(3.0, 2.0), (0.7, 1.5)], ids=["dot", "dust"])
def test_a_dot_is_masked_and_little_else(scene, material, change, radius):
    stokes, inside, rings = SCENES[scene](*MATERIALS[material])
    spot = np.hypot(X - 150.0, Y - 84.0) <= radius
    stokes[spot] *= change
    masked = highlights(measured(stokes, 1), inside, rings)
    assert masked[spot].all()
    assert not masked[np.hypot(X - 150.0, Y - 84.0) > radius + 2.5].any()


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("material", ["glass", "dense"])  # gold polarizes too little to lose it
def test_a_wall_beside_the_sample_is_masked(scene, material):
    """Unpolarized light, a third of the signal at the right edge, gone a quarter of the picture further in."""
    stokes, inside, rings = SCENES[scene](*MATERIALS[material])
    distance = X.max() - X if rings is None else CENTRE[0] + RADIUS - X
    veil = np.where(distance < 60, (1 - distance / 60).clip(0) ** 2, 0.0)
    veil *= 1.0 if rings is None else np.abs(Y - CENTRE[1]) < 40
    level = np.nanmedian(stokes[..., 0][inside])
    polarized = np.hypot(stokes[..., 1], stokes[..., 2]) / stokes[..., 0]
    stokes[..., 0] += 0.5 * level * veil
    masked = stray_light(measured(stokes, 2), inside, rings)
    # Where the veil takes away more than a twentieth of the degree of polarization.
    lost = polarized * 0.5 * level * veil / stokes[..., 0]
    heavy = inside & (lost > 0.05)
    assert heavy.sum() > 200
    assert masked[heavy].mean() > 0.8
    assert masked[inside & (veil == 0)].mean() < 0.02


@pytest.mark.parametrize("scene", SCENES)
def test_a_textured_sample_is_no_field_of_highlights(scene):
    stokes, inside, rings = SCENES[scene](*MATERIALS["glass"])
    texture = np.exp(0.1 * np.random.default_rng(3).standard_normal((SIDE, SIDE)))
    maps = measured(stokes, 4, texture=texture)
    assert highlights(maps, inside, rings).mean() < 1e-3
    assert not stray_light(maps, inside, rings).any()


def test_a_slope_does_not_stand_out_at_the_edges():
    """Light that grows sixfold across the picture, as beside a near lamp: nothing of it is a highlight."""
    level = np.broadcast_to(np.linspace(1500.0, 9000.0, 375), (250, 375))
    noise = np.random.default_rng(6).normal(1.0, 0.002, level.shape)
    stokes = StokesMaps(level * noise, np.zeros(level.shape), np.zeros(level.shape), None)
    assert not highlights(stokes, np.ones(level.shape, dtype=bool)).any()


@pytest.mark.parametrize("material", MATERIALS)
def test_a_colour_beside_the_middle_of_its_cell_is_no_highlight(material):
    """Near a ball's rim half a pixel changes the brightness by more than a dot."""
    stokes, inside, _ = ball(*MATERIALS[material])
    red, inside = stokes[::2, ::2], inside[::2, ::2]
    right, up = X[::2, ::2] + 0.5 - CENTRE[0], CENTRE[1] - Y[::2, ::2] - 0.5
    distance = np.hypot(right, up)
    rings = Rings(np.arcsin(np.where(distance < RADIUS, distance / RADIUS, np.nan)), np.arctan2(up, right))
    maps = stokes_maps(
        np.stack([red @ analyzer_weights(axis) for axis in AXES_DEG]), np.radians(AXES_DEG), 1.0
    )
    assert not highlights(maps, inside & np.isfinite(rings.theta), rings).any()
