"""Rendered captures against the closed forms where those are exact, and what only a render can show.

Catches frames, signs and pixel centres that differ between the tracer and the closed forms: what a sample mirrors
of an even lamp or sky has no noise, so both agree to single precision.
"""

from dataclasses import replace

import numpy as np
import pytest

from reflectance_fit.data_synthetic import room
from reflectance_fit.data_synthetic.arrangement import views
from reflectance_fit.data_synthetic.picture import Optics, stokes_image
from reflectance_fit.data_synthetic.rig import LIGHTS
from reflectance_fit.data_synthetic.spec import MONO_CHANNELS, standard_spec
from reflectance_fit.errors import ReflectanceFitError

GOLD = (0.35, 2.7)
CHANNEL = MONO_CHANNELS[0]


def pictures(monkeypatch, shape, light):
    """Both pictures of a gold sample in one channel, shape (h, w, 4), and the scene."""
    monkeypatch.setattr(room, "_SAMPLES", 16)
    spec = standard_spec(
        "Au",
        shape=shape,
        surroundings="room",
        sensor="mono",
        light=LIGHTS[light],
        angles_deg=(50.0,) * (shape == "board"),
    )
    sensor = replace(spec.sensor, width=208, height=156)
    optics = Optics(spec.optics.focal_px / 4)
    scene = next(views(replace(spec, sensor=sensor, optics=optics))).scene
    names = {site.colour for site in sensor.cell()}
    indices = dict.fromkeys(names, GOLD)
    rendered = scene.image(sensor, indices, dict.fromkeys(names, CHANNEL.wavelength_nm), optics, 0)
    return rendered, stokes_image(scene.inner, sensor, indices, optics), scene.inner


def test_a_ball_mirrors_the_sky_as_in_closed_form_and_the_table_as_only_a_render_can(monkeypatch):
    rendered, closed, ball = pictures(monkeypatch, "sphere", "circular")
    theta, _ = ball.incidence(np.arange(208.0), np.arange(156.0)[:, None])
    # Of what faces up most, no ray meets the table.
    sky = (np.degrees(theta) < 60.0) & (np.arange(156)[:, None] < 50)
    assert sky.sum() > 500
    # Sixteen points of a pixel are off its middle by 0.07 pixels; over it the direction of s turns by up to 1/20.
    np.testing.assert_allclose(rendered[sky], closed[sky], rtol=0, atol=4 * 2 * 0.07 / 20)
    np.testing.assert_allclose(rendered[sky].mean(axis=0), closed[sky].mean(axis=0), rtol=0, atol=5e-4)
    table = (np.degrees(theta) < 60.0) & (np.arange(156)[:, None] > 105)
    assert np.all(rendered[table][:, 0] < 0.5 * closed[table][:, 0])
    # What comes from the table has lost its polarization there, and metal makes little of it.
    assert np.abs(rendered[table][:, 3]).max() < 0.05 * np.abs(closed[table][:, 3]).max()


def test_a_sample_in_a_board_mirrors_the_softbox_as_in_closed_form(monkeypatch):
    rendered, closed, board = pictures(monkeypatch, "board", "linear45")
    x, y = np.arange(208.0), np.arange(156.0)[:, None]
    theta, _ = board.incidence(x, y)
    bright = closed[..., 0] > 0.5
    inside = (
        bright
        & np.roll(bright, 2, 0)
        & np.roll(bright, -2, 0)
        & np.roll(bright, 2, 1)
        & np.roll(bright, -2, 1)
    )
    assert inside.sum() > 500
    assert 40 < np.degrees(theta[inside]).mean() < 60
    # The closed form's light has one state in each point's own (s, p) frame, a softbox has one in space: they agree
    # in the middle.  Elsewhere s is turned by up to 0.06, and S1 becomes 0.12 of S2, of which S0 gains (R_s - R_p) / 2.
    np.testing.assert_allclose(rendered[inside][:, 0], closed[inside][:, 0], rtol=0, atol=0.12 * 0.08)
    centre = inside & (abs(x - 103.5) < 6) & (abs(y - 77.5) < 4)
    np.testing.assert_allclose(rendered[centre], closed[centre], rtol=0, atol=0.03)
    np.testing.assert_allclose(rendered[centre].mean(axis=0), closed[centre].mean(axis=0), rtol=0, atol=0.004)
    # Paper is lit by the softbox and does not polarize; printed squares are darker.
    paper = np.abs(rendered[..., 1:]).max(axis=-1) < 1e-6
    lit = rendered[paper & (rendered[..., 0] > 0)][:, 0]
    assert np.percentile(lit, 95) > 5 * np.percentile(lit, 5)


def test_a_room_needs_perspective_and_no_wedge(monkeypatch):
    with pytest.raises(ReflectanceFitError, match="flat sample fills"):
        standard_spec("N-BK7", surroundings="room")
    spec = standard_spec("N-BK7", shape="sphere", surroundings="room", sensor="mono")
    scene = next(views(spec)).scene
    with pytest.raises(ValueError, match="wedge"):
        scene.image(spec.sensor, {}, {}, Optics(spec.optics.focal_px, wedge_px=1.0), 0)
