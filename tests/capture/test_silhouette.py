"""Outlines of balls rendered by exact Fresnel: centre and radius to what angles need, in both kinds of camera."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from reflectance_fit.capture.camera import Camera, ball_incidence
from reflectance_fit.capture.frames import Ball, Sphere
from reflectance_fit.capture.outline import Outline, ball_of_outline, joined
from reflectance_fit.capture.raw import RawFrame
from reflectance_fit.capture.ray_bins import rim
from reflectance_fit.capture.silhouette import outline_of
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.physics.fresnel import reflectances

CENTRE, RADIUS = (250.3, 197.8), 140.4
UNPOLARIZED = np.full((2, 2), np.nan)


def photographed(eta, k, ground, blur=0.8, noise=0.01, fine=5, radius=RADIUS, light=(1.0, 1.0)):
    """A ball that mirrors an even surround before a ground, seen from afar; a pixel is the mean of fine x fine points.

    ``light`` is how much each of s and p counts; the sensor has no filters.
    """
    height, width = 400, 520
    y, x = (np.mgrid[0 : height * fine, 0 : width * fine] + 0.5) / fine - 0.5
    sine = np.hypot(x - CENTRE[0], y - CENTRE[1]) / radius
    picture = np.full(sine.shape, float(ground))
    on = sine < 1
    powers = reflectances(np.sqrt(1 - sine[on] ** 2), eta, k)
    picture[on] = (light[0] * powers.s + light[1] * powers.p) / 2
    picture = gaussian_filter(picture.reshape(height, fine, width, fine).mean(axis=(1, 3)), blur)
    rng = np.random.default_rng(0)
    picture += noise * np.sqrt(np.maximum(picture, 0.01)) * rng.normal(size=picture.shape)
    return frame_of(picture)


def frame_of(picture, axes_deg=UNPOLARIZED):
    """As a sensor without colour filters records it, on a black level of 500."""
    return RawFrame(
        cfa=np.round(500 + 20000 * np.clip(picture, 0.0, 3.0)).astype(np.uint16),
        channels=np.full((2, 2), "mono"),
        axes_deg=axes_deg,
        black=np.full((2, 2), 500.0),
        white=np.full((2, 2), 65535.0),
        exposure_s=None,
        iso=None,
        noise_profile=None,
    )


def off_at(angle_deg, ball, radius=RADIUS):
    """By how much an angle of incidence is wrong for the radius and the middle of the ball, degrees."""
    off = abs(ball.radius_px - radius) + math.dist(ball.center_px, CENTRE)
    return math.degrees(math.tan(math.radians(angle_deg)) * off / radius)


@pytest.mark.parametrize(
    ("eta", "k", "ground"),
    [(1.52, 0.0, 0.02), (0.96, 6.7, 0.05), (1.52, 0.0, 0.3)],
    ids=["glass on black", "aluminium on black", "glass on grey"],
)
def test_a_ball_before_a_ground_is_found_to_a_twentieth_of_a_degree(eta, k, ground):
    assert off_at(65, outline_of(photographed(eta, k, ground)).ball(None)) < 0.05


@pytest.mark.parametrize(
    ("eta", "blur", "light"),
    [(1.33, 0.6, (1.0, 1.0)), (1.52, 1.2, (1.0, 1.0)), (1.52, 0.6, (0.4, 1.6)), (2.0, 0.8, (1.0, 1.0))],
)
def test_a_ball_that_melts_into_its_surround_is_found_to_a_twentieth_of_a_degree(eta, blur, light):
    """No step at all there, only the root.  A model of it with a step was 0.1 px too small, 0.1 degrees."""
    assert off_at(70, outline_of(photographed(eta, 0.0, 1.0, blur, light=light)).ball(None)) < 0.05


def test_polarizers_on_the_pixels_are_seen_each_on_its_own():
    """Pixels behind crossed polarizers differ by half of the light; their rim is at one place."""
    seen = [photographed(1.52, 0.0, 1.0, light=light).cfa for light in ((1.6, 0.4), (0.4, 1.6))]
    cfa = np.where(np.indices(seen[0].shape).sum(axis=0) % 2, *seen)
    frame = replace(frame_of(np.zeros((2, 2)), np.array([[0.0, 90.0], [90.0, 0.0]])), cfa=cfa)
    assert off_at(70, outline_of(frame).ball(None)) < 0.05


def test_no_ball_is_said():
    rng = np.random.default_rng(1)
    for picture in (np.zeros((200, 300)), rng.normal(1.0, 0.05, (200, 300)), np.eye(300)[:200]):
        with pytest.raises(ReflectanceFitError, match="does not show the outline"):
            outline_of(frame_of(picture))


CAMERA = Camera(3000.0, 999.5, 749.5)


def drawn(axis, half_angle, noise=0.0, count=96):
    points = CAMERA.pixels(rim(axis, half_angle, count))
    return Outline(points + noise * np.random.default_rng(2).normal(size=points.shape), noise, (1500, 2000))


@pytest.mark.parametrize("away", [(0.0, 0.0), (0.2, -0.1)])
def test_rays_that_touch_give_the_cone(away):
    """Exact without noise; with 0.05 px the angles at the rim's inside are right to 0.01 degrees."""
    axis = np.array([*away, 1.0]) / math.hypot(*away, 1.0)
    ball = drawn(axis, 0.1).ball(CAMERA)
    assert isinstance(ball, Ball)
    assert np.array(ball.axis) == pytest.approx(axis, abs=1e-10)
    assert ball.half_angle == pytest.approx(0.1, abs=1e-10)
    noisy = drawn(axis, 0.1, noise=0.05).ball(CAMERA)
    rays = rim(axis, math.asin(math.sin(0.1) * math.sin(math.radians(65))), 72)
    theta, _, _ = ball_incidence(rays, np.array(noisy.axis), noisy.half_angle)
    assert math.degrees(theta.mean()) == pytest.approx(65, abs=0.02)
    assert np.degrees(theta) == pytest.approx(65, abs=0.05)
    assert 0 < noisy.half_angle_sigma < 1e-4


@pytest.mark.parametrize("away", [(0.0, 0.0), (0.25, 0.1)])
def test_a_stated_circle_is_the_ellipse_of_its_ball(away):
    """The middle of the outline and its smaller half-axis, measured on the outline itself."""
    axis = np.array([*away, 1.0]) / math.hypot(*away, 1.0)
    points = drawn(axis, 0.15, count=7200).points
    along = np.array(away) / math.hypot(*away) if any(away) else np.array([1.0, 0.0])
    middle = CAMERA.cx, CAMERA.cy
    lengths = (points - middle) @ along
    sideways = (points - middle) @ np.array([-along[1], along[0]])
    centre = np.array(middle) + along * (lengths.max() + lengths.min()) / 2
    ball = ball_of_outline(Sphere((float(centre[0]), float(centre[1])), float(np.ptp(sideways)) / 2), CAMERA)
    assert np.array(ball.axis) == pytest.approx(axis, abs=2e-6)
    assert ball.half_angle == pytest.approx(0.15, abs=2e-6)


def test_from_afar_the_cone_is_the_circle():
    far = Camera(1e7, 999.5, 749.5)
    turn = np.linspace(0, 2 * math.pi, 50, endpoint=False)
    points = np.stack([1100 + 300 * np.cos(turn), 700 + 300 * np.sin(turn)], axis=-1)
    outline = joined([Outline(points, 0.01, (1500, 2000))] * 2)
    circle, cone = outline.ball(None), outline.ball(far)
    assert circle.center_px == pytest.approx((1100, 700), abs=1e-9)
    assert circle.radius_px == pytest.approx(300, abs=1e-9)
    assert isinstance(cone, Ball)
    assert math.tan(cone.half_angle) * 1e7 == pytest.approx(300, rel=1e-4)
