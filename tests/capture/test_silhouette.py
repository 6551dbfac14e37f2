"""Outlines of balls rendered by exact Fresnel: centre and radius to what angles need, in both kinds of camera."""

import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from reflectance_fit.capture.camera import Camera, ball_incidence
from reflectance_fit.capture.frames import Ball, Sphere
from reflectance_fit.capture.outline import Outline, ball_of_outline, joined
from reflectance_fit.capture.ray_bins import rim
from reflectance_fit.capture.silhouette import find_outline
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.physics.fresnel import reflectances

CENTRE, RADIUS = (250.3, 197.8), 140.4


def photographed(eta, k, ground, blur=0.8, noise=0.01, fine=5, light=1.0):
    """A ball that mirrors an even surround before a ground, seen from afar; the pixel's mean of fine x fine points."""
    height, width = 400, 520
    y, x = (np.mgrid[0 : height * fine, 0 : width * fine] + 0.5) / fine - 0.5
    sine = np.hypot(x - CENTRE[0], y - CENTRE[1]) / RADIUS
    picture = np.full(sine.shape, float(ground))
    on = sine < 1
    picture[on] = light * reflectances(np.sqrt(1 - sine[on] ** 2), eta, k).mean
    picture = gaussian_filter(picture.reshape(height, fine, width, fine).mean(axis=(1, 3)), blur)
    return picture + noise * np.sqrt(np.maximum(picture, 0.01)) * np.random.default_rng(0).normal(
        size=picture.shape
    )


@pytest.mark.parametrize(
    ("eta", "k", "ground"),
    [(1.52, 0.0, 0.02), (0.96, 6.7, 0.05), (1.52, 0.0, 0.3)],
    ids=["glass on black", "aluminium on black", "glass on grey"],
)
def test_a_ball_before_a_ground_is_found_to_a_twentieth_of_a_degree(eta, k, ground):
    """At 65 degrees of incidence: an error of the radius counts there tan(65) times."""
    points, _ = find_outline(photographed(eta, k, ground))
    ball = Outline(points, 0.01, (400, 520)).ball(None)
    assert ball.center_px == pytest.approx(CENTRE, abs=0.02)
    assert math.degrees(math.tan(math.radians(65)) * abs(ball.radius_px / RADIUS - 1)) < 0.05


def test_a_ball_whose_rim_melts_into_its_surround_is_found():
    """No step at all there, only the root: the last 0.1 px are not to be had."""
    points, _ = find_outline(photographed(1.52, 0.0, 1.0))
    ball = Outline(points, 0.01, (400, 520)).ball(None)
    assert ball.center_px == pytest.approx(CENTRE, abs=0.06)
    assert ball.radius_px == pytest.approx(RADIUS, abs=0.15)


def test_no_ball_is_said():
    rng = np.random.default_rng(1)
    for picture in (np.zeros((200, 300)), rng.normal(1.0, 0.05, (200, 300)), np.eye(300)[:200]):
        with pytest.raises(ReflectanceFitError, match="does not show the outline"):
            find_outline(picture)


CAMERA = Camera(3000.0, 999.5, 749.5)


def outline_of(axis, half_angle, noise=0.0, count=96):
    points = CAMERA.pixels(rim(axis, half_angle, count))
    return Outline(points + noise * np.random.default_rng(2).normal(size=points.shape), noise, (1500, 2000))


@pytest.mark.parametrize("away", [(0.0, 0.0), (0.2, -0.1)])
def test_rays_that_touch_give_the_cone(away):
    """Exact without noise; with 0.05 px the angles at the rim's inside are right to 0.01 degrees."""
    axis = np.array([*away, 1.0]) / math.hypot(*away, 1.0)
    ball = outline_of(axis, 0.1).ball(CAMERA)
    assert isinstance(ball, Ball)
    assert np.array(ball.axis) == pytest.approx(axis, abs=1e-10)
    assert ball.half_angle == pytest.approx(0.1, abs=1e-10)
    noisy = outline_of(axis, 0.1, noise=0.05).ball(CAMERA)
    rays = rim(axis, math.asin(math.sin(0.1) * math.sin(math.radians(65))), 72)
    theta, _, _ = ball_incidence(rays, np.array(noisy.axis), noisy.half_angle)
    assert math.degrees(theta.mean()) == pytest.approx(65, abs=0.02)
    assert np.degrees(theta) == pytest.approx(65, abs=0.05)
    assert 0 < noisy.half_angle_sigma < 1e-4


@pytest.mark.parametrize("away", [(0.0, 0.0), (0.25, 0.1)])
def test_a_stated_circle_is_the_ellipse_of_its_ball(away):
    """The middle of the outline and its smaller half-axis, measured on the outline itself."""
    axis = np.array([*away, 1.0]) / math.hypot(*away, 1.0)
    points = outline_of(axis, 0.15, count=7200).points
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
