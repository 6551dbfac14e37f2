"""Rays and angles of incidence against OpenCV's projection and against geometry done by intersection."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reflectance_fit.capture.bins import Region
from reflectance_fit.capture.camera import Camera, ball_incidence, incidence, tilted_normals
from reflectance_fit.capture.ray_bins import BallBins, PlaneBins, rim

CAMERA = Camera(3000.0, 2011.0, 1480.0, -0.15, 0.05)
FIELD = st.floats(-0.35, 0.35)
THETA = st.floats(0.02, 1.5)
TURN = st.floats(-math.pi, math.pi)


def unit(x, y, z=1.0):
    return np.array([x, y, z]) / math.sqrt(x * x + y * y + z * z)


def apart(one, other):
    """Difference of two directions without a sense."""
    return abs(math.remainder(one - other, math.pi))


def test_rays_are_opencvs_projection_backwards():
    x, y = np.meshgrid(np.linspace(0, 4000, 11), np.linspace(0, 3000, 11))
    rays = CAMERA.rays(x, y)
    assert np.linalg.norm(rays, axis=-1) == pytest.approx(1.0, abs=1e-14)
    matrix = np.array([[3000, 0, 2011.0], [0, 3000, 1480.0], [0, 0, 1]])
    seen, _ = cv2.projectPoints(
        rays.reshape(-1, 3), np.zeros(3), np.zeros(3), matrix, np.array([-0.15, 0.05, 0, 0])
    )
    places = np.stack([x, y], axis=-1)
    assert np.reshape(seen, places.shape) == pytest.approx(places, abs=1e-8)
    assert CAMERA.pixels(rays) == pytest.approx(places, abs=1e-8)


@given(x=FIELD, y=FIELD, theta=THETA, s=TURN)
def test_both_leaning_planes_are_met_at_the_angle_and_direction_asked_for(x, y, theta, s):
    ray = unit(x, y)
    for normal in tilted_normals(ray, theta, s):
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
        found, direction = incidence(ray, normal)
        assert found == pytest.approx(theta, abs=1e-12)
        assert apart(direction, s) < 1e-12


@given(theta=THETA, s=TURN)
def test_on_the_axis_s_is_across_the_plane_of_incidence_as_displayed(theta, s):
    """A normal that leans up the picture has s along its horizontal; turned counter-clockwise, s turns with it."""
    towards = s + math.pi / 2
    normal = np.array(
        [math.sin(theta) * math.cos(towards), -math.sin(theta) * math.sin(towards), -math.cos(theta)]
    )
    found, direction = incidence(np.array([0.0, 0.0, 1.0]), normal)
    assert found == pytest.approx(theta, abs=1e-12)
    assert apart(direction, s) < 1e-9


@given(x=FIELD, y=FIELD, theta=THETA, s=TURN)
def test_the_incident_ray_is_mirrored_into_the_view(x, y, theta, s):
    """The light's ray, mirrored at the normal, is in one plane with it and as steep."""
    ray = unit(x, y)
    normal, _ = tilted_normals(ray, theta, s)
    to_light = ray - 2 * (ray @ normal) * normal
    assert math.acos(np.clip(to_light @ normal, -1, 1)) == pytest.approx(theta, abs=1e-7)


@given(x=FIELD, y=FIELD, radius=st.floats(0.05, 0.9), off=st.floats(0.001, 0.99), turn=TURN)
def test_a_ball_is_met_where_its_rays_intersect_it(x, y, radius, off, turn):
    """Against the root of the quadratic equation of ray and sphere, centre at distance 1."""
    axis = unit(x, y)
    half_angle = math.asin(radius)
    ray = rim(axis, off * half_angle, 360)[int(turn * 57) % 360]
    theta, direction, inside = ball_incidence(ray[None], axis, half_angle)
    assert inside[0]
    along = ray @ axis
    point = ray * (along - math.sqrt(along**2 - 1 + radius**2))
    normal = (point - axis) / radius
    wanted, s = incidence(ray, normal)
    assert theta[0] == pytest.approx(float(wanted), abs=1e-7)
    assert apart(direction[0], float(s)) < 1e-6
    outside = rim(axis, 1.001 * half_angle, 8)
    assert not ball_incidence(outside, axis, half_angle)[2].any()


def test_a_box_holds_its_ball_and_little_else():
    axis = unit(0.2, -0.15)
    bins = BallBins(CAMERA, tuple(axis), 0.1, 0.3, (0.1, 0.7, 1.3), 6)
    rows, columns = bins.box()
    y, x = np.mgrid[max(0, rows.start - 50) : rows.stop + 50, max(0, columns.start - 50) : columns.stop + 50]
    full = BallBins(CAMERA, tuple(axis), 0.1, 0.3, (0.0, math.pi / 2), 1)
    inside, theta, s = full.angles(x.ravel().astype(float), y.ravel().astype(float))
    seen_y, seen_x = y.ravel()[inside], x.ravel()[inside]
    assert rows.start <= seen_y.min() <= rows.start + 3
    assert rows.stop - 4 <= seen_y.max() < rows.stop
    assert columns.start <= seen_x.min() <= columns.start + 3
    assert columns.stop - 4 <= seen_x.max() < columns.stop
    assert len(theta) == len(s) == inside.sum()
    ringed, theta, _ = bins.angles(x.ravel().astype(float), y.ravel().astype(float))
    assert theta.min() >= 0.1
    assert theta.max() < 1.3
    assert 0 < ringed.sum() < inside.sum()


def test_plane_bins_see_the_pixels_of_their_region_alone():
    normal = tilted_normals(CAMERA.rays(np.array(1500.0), np.array(1200.0)), 0.8, 0.1)[0]
    bins = PlaneBins(CAMERA, tuple(normal), Region(1400, 1100, 1601, 1301), None, (0.0, 1.5))
    x, y = (a.ravel().astype(float) for a in np.meshgrid(np.arange(1390, 1611), np.arange(1090, 1311)))
    inside, theta, _ = bins.angles(x, y)
    assert inside.sum() == 201 * 201
    assert theta[len(theta) // 2] == pytest.approx(0.8, abs=1e-9)
    narrow = PlaneBins(CAMERA, tuple(normal), bins.region, None, (0.79, 0.81))
    _, inner, _ = narrow.angles(x, y)
    assert len(inner) == np.sum((theta >= 0.79) & (theta < 0.81))
