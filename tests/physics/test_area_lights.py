"""Area lights: closed, area and spherical form against each other, published values, 50-digit contours.

The three forms share no formula: contour sums, integrals over the light, integrals over directions.
"""

import mpmath
import numpy as np
import pytest

from reflectance_fit.physics.area_form import irradiance_by_area
from reflectance_fit.physics.area_lights import DiskLight, RectangleLight, SphereLight
from reflectance_fit.physics.brdf import modified_phong
from reflectance_fit.physics.cones import cone_solid_angle
from reflectance_fit.physics.direction_form import irradiance_by_direction
from reflectance_fit.physics.light_irradiance import irradiance, solid_angle
from reflectance_fit.physics.reflection import outgoing_radiance

UP = np.array([0.0, 0.0, 1.0])


def random_frame(rng):
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return axes * np.sign(np.linalg.det(axes))


def random_light(kind, rng):
    x, y, z = random_frame(rng)
    center, (a, b) = rng.normal(size=3), rng.uniform(0.2, 3.0, 2)
    if kind == "rectangle":
        return RectangleLight(center, a * x, b * y, 1.7)
    return DiskLight(center, z, a, 1.7) if kind == "disk" else SphereLight(center, a / 2, 1.7)


def random_scenes(kind, n, seed):
    """Lights with receivers that see some of them; the horizon cuts a third or more."""
    rng, found = np.random.default_rng(seed), 0
    while found < n:
        light, position, normal = random_light(kind, rng), 2.0 * rng.normal(size=3), rng.normal(size=3)
        if kind == "sphere" and np.linalg.norm(position - light.center) <= 1.001 * light.radius:
            continue
        if irradiance(light, position, normal) > 0.0:
            found += 1
            yield light, position, normal


@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere"])
def test_three_forms_agree(kind):
    for light, position, normal in random_scenes(kind, 25, seed=1):
        closed = irradiance(light, position, normal)
        area, spherical = (f(light, position, normal) for f in (irradiance_by_area, irradiance_by_direction))
        assert area.converged
        assert spherical.converged
        assert area.value == pytest.approx(closed, rel=1e-10, abs=0)
        assert spherical.value == pytest.approx(closed, rel=1e-10, abs=0)


@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere"])
def test_hidden_lights_give_nothing_in_any_form(kind):
    rng = np.random.default_rng(2)
    for _ in range(20):
        light = random_light(kind, rng)
        normal = rng.normal(size=3)
        position = np.asarray(light.corner if kind == "rectangle" else light.center) + 9.0 * normal
        forms = irradiance, irradiance_by_area, irradiance_by_direction
        for value in (f(light, position, normal) for f in forms):
            assert getattr(value, "value", value) == 0.0


@pytest.mark.parametrize(("x", "y"), [(1.0, 1.0), (0.5, 2.0), (10.0, 1e-3), (40.0, 10.0)])
def test_rectangle_under_its_corner(x, y):
    """Element parallel to a rectangle at distance 1: Siegel & Howell, Thermal Radiation Heat Transfer."""
    light = RectangleLight([0, 0, 1], [0, y, 0], [x, 0, 0])
    p, q = np.hypot(1, x), np.hypot(1, y)
    expected = (x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2 * np.pi)
    assert irradiance(light, [0, 0, 0], UP) / np.pi == pytest.approx(expected, rel=1e-12, abs=0)


def test_rectangle_perpendicular_to_the_receiver():
    """Element under the corner, in a plane perpendicular to the rectangle's: the same book."""
    a, b, c = 1.3, 0.7, 2.1
    far = np.hypot(c, a)
    expected = (np.arctan(b / c) - c / far * np.arctan(b / far)) / (2 * np.pi)
    light = RectangleLight([c, 0, 0], [0, 0, a], [0, b, 0])
    assert irradiance(light, [0, 0, 0], UP) / np.pi == pytest.approx(expected, rel=1e-12, abs=0)


@pytest.mark.parametrize("h", [1e-3, 0.3, 1.0, 30.0, 1e6])
@pytest.mark.parametrize("a", [1e-9, 0.4, 0.999, 1.5, 8.0, 1e5])
def test_disk_parallel_and_perpendicular(h, a):
    """Elements parallel and perpendicular to a unit disk, off its axis by a: Howell's catalog (1982).

    In 60 digits, because the catalog's formulas cancel.
    """
    light = DiskLight([0, 0, 0], [0, 0, 1], 1.0)
    with mpmath.workdps(60):
        x, z = mpmath.mpf(a), mpmath.mpf(h)
        s = z * z + x * x + 1
        root = mpmath.sqrt(s * s - 4 * x * x)
        parallel, perpendicular = float((1 - (s - 2) / root) / 2), float(z / (2 * x) * (s / root - 1))
    assert irradiance(light, [a, 0, h], -UP) / np.pi == pytest.approx(parallel, rel=1e-12, abs=0)
    if a > 1:
        # Facing the axis, from outside: all of the disk is above the horizon.
        assert irradiance(light, [a, 0, h], [-1, 0, 0]) / np.pi == pytest.approx(
            perpendicular, rel=1e-12, abs=0
        )


@pytest.mark.parametrize(
    "light", [RectangleLight([-1, -1, 0], [2, 0, 0], [0, 2, 0]), DiskLight([0, 0, 0], UP, 1.0)]
)
@pytest.mark.parametrize(
    ("position", "normal"),
    [
        pytest.param([0.1, 0.2, 1e-6], [0, 0, -1], id="touching"),
        pytest.param([0.1, 0.2, 1e-3], [0.5, 0, -1], id="touching, tilted"),
        pytest.param([0.3, -0.2, 0.01], [1, 0.3, 0], id="touching, upright"),
        pytest.param([1.5, 0.2, 1e-6], [-1, 0, 0], id="edge-on"),
        pytest.param([1e5, 0, 1e3], [-1e3, 0, 1e5], id="far, setting"),
    ],
)
def test_area_form_converges_at_the_extremes(light, position, normal):
    found = irradiance_by_area(light, position, normal)
    assert found.converged
    assert found.value == pytest.approx(irradiance(light, position, normal), rel=1e-10, abs=0)


@pytest.mark.parametrize("theta", [0.3, 1.2, 1.8, 2.5])
def test_a_disk_almost_on_its_axis_is_one_on_it(theta):
    """Seen along a slanted axis the receiver is off by rounding, of which no direction may be made."""
    rng = np.random.default_rng(11)
    for _ in range(20):
        axes = random_frame(rng)
        normal = np.array([np.sin(theta), 0, np.cos(theta)])
        light, slanted = DiskLight([0, 0, 0.4], -UP, 1.0), DiskLight(0.4 * axes[2], -axes[2], 1.0)
        expected = irradiance(light, [0, 0, 0], normal)
        assert irradiance(slanted, [0, 0, 0], normal @ axes) == pytest.approx(expected, rel=1e-12, abs=0)


@pytest.mark.parametrize("theta", [0.3, 1.2, 1.8, 2.5])
def test_sphere_is_the_disk_of_its_limb(theta):
    d, radius = 1.4, 0.9
    normal = [np.sin(theta), 0, np.cos(theta)]
    cosine2 = 1 - (radius / d) ** 2
    disk = DiskLight([0, 0, d * cosine2], [0, 0, -1], radius * np.sqrt(cosine2))
    sphere = SphereLight([0, 0, d], radius)
    assert irradiance(sphere, [0, 0, 0], normal) == pytest.approx(
        irradiance(disk, [0, 0, 0], normal), rel=1e-12, abs=0
    )
    assert solid_angle(sphere, [0, 0, 0]) == pytest.approx(solid_angle(disk, [0, 0, 0]), rel=1e-14, abs=0)


def fifty_digit_contour(light, position, normal):
    """Lambert's sum over the clipped polygon in mpmath."""
    with mpmath.workdps(50):

        def vec(x):
            return mpmath.matrix([mpmath.mpf(float(c)) for c in x])

        def dot(a, b):
            return sum(a[i] * b[i] for i in range(3))

        def cross(a, b):
            return mpmath.matrix(
                [a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3] for i in range(3)]
            )

        n = vec(normal)
        n = n / mpmath.sqrt(dot(n, n))
        first, u, v = (vec(x) for x in (light.corner - np.zeros(3), light.edge_u, light.edge_v))
        points = [first + e - vec(position) for e in (0 * u, u, u + v, v)]
        clipped = []
        for a, b in zip(points, points[1:] + points[:1], strict=True):
            ha, hb = dot(n, a), dot(n, b)
            if ha >= 0:
                clipped.append(a)
            if (ha >= 0) != (hb >= 0):
                clipped.append(a + (b - a) * (ha / (ha - hb)))
        total = mpmath.mpf(0)
        for a, b in zip(clipped, clipped[1:] + clipped[:1], strict=True):
            c = cross(a, b)
            length = mpmath.sqrt(dot(c, c))
            if length > 0:
                total += mpmath.atan2(length, dot(a, b)) * dot(n, c) / length
        return -float(total / 2)


@pytest.mark.parametrize("far", [10.0, 1e3, 1e6, 1e9])
def test_far_rectangles_keep_their_digits(far):
    rng = np.random.default_rng(int(np.log10(far)))
    for _ in range(6):
        x, y, z = random_frame(rng)
        light = RectangleLight([0, 0, 0], rng.uniform(0.1, 1) * x, rng.uniform(0.1, 1) * y)
        position = far * (rng.uniform(-1, 1) * x + rng.uniform(-1, 1) * y + rng.uniform(0.1, 1) * z)
        normal = -position / far + 0.3 * rng.normal(size=3)
        expected = fifty_digit_contour(light, position, normal)
        assert irradiance(light, position, normal) == pytest.approx(expected, rel=1e-11, abs=0)


@pytest.mark.parametrize(
    ("edges", "position", "normal"),
    [
        pytest.param((2, 2), [1, 1, 1e-8], [0, 0, -1], id="touching the light"),
        pytest.param((2, 2), [1, 1, 1e-3], [1, 0, -1], id="touching, tilted"),
        pytest.param((2, 2), [2 + 1e-6, 1, 1e-6], [-1, 0, 0], id="at an edge"),
        pytest.param((2, 2), [5, 1, 1e-7], [-1, 0, 0.2], id="light edge-on"),
        pytest.param((2, 1e-8), [1, 0.3, 0.5], [0, 0, -1], id="thin tube"),
        pytest.param((1e-7, 2e-7), [1, 0.3, 0.5], [-1, 0.2, -0.3], id="tiny"),
        pytest.param((2, 2), [1, 5, 3], [0, 0.6001, 1.0001], id="about to set"),
        pytest.param((2, 2), [1, 1, 1e3], [1, 0, -5e-4], id="far and cut by the horizon"),
    ],
)
def test_extreme_rectangles(edges, position, normal):
    light = RectangleLight([0, 0, 0], [edges[0], 0, 0], [0, edges[1], 0])
    expected = fifty_digit_contour(light, position, normal)
    assert irradiance(light, position, normal) == pytest.approx(expected, rel=1e-10, abs=0)


@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere"])
def test_far_lights_follow_the_inverse_square(kind):
    light = random_light(kind, np.random.default_rng(7))
    axis = UP if kind == "sphere" else np.asarray(light.normal)
    if kind == "rectangle":
        area = np.linalg.norm(light.edge_u) * np.linalg.norm(light.edge_v)
        center = light.corners.mean(axis=0)
    else:
        area, center = np.pi * light.radius**2, np.asarray(light.center)
    for far in (1e6, 1e9):
        position = center + far * axis
        # Next order: (size / far)^2.
        assert irradiance(light, position, -axis) == pytest.approx(1.7 * area / far**2, rel=1e-10, abs=0)
        assert solid_angle(light, position) == pytest.approx(area / far**2, rel=1e-10, abs=0)


def test_splitting_a_rectangle_changes_nothing():
    for light, position, normal in random_scenes("rectangle", 25, seed=3):
        u, v = np.asarray(light.edge_u), np.asarray(light.edge_v)
        first = RectangleLight(light.corner, 0.3 * u, v, light.radiance)
        second = RectangleLight(light.corner + 0.3 * u, 0.7 * u, v, light.radiance)
        halves = irradiance(first, position, normal) + irradiance(second, position, normal)
        assert halves == pytest.approx(irradiance(light, position, normal), rel=1e-11, abs=0)
        angles = solid_angle(first, position) + solid_angle(second, position)
        assert angles == pytest.approx(solid_angle(light, position), rel=1e-13, abs=0)


@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere"])
def test_turning_everything_changes_nothing(kind):
    rng = np.random.default_rng(4)
    for light, position, normal in random_scenes(kind, 25, seed=4):
        turn = random_frame(rng)
        if kind == "rectangle":
            other = RectangleLight(turn @ light.corner, turn @ light.edge_u, turn @ light.edge_v, 1.7)
        elif kind == "disk":
            other = DiskLight(turn @ light.center, turn @ light.normal, light.radius, 1.7)
        else:
            other = SphereLight(turn @ light.center, light.radius, 1.7)
        turned = irradiance(other, turn @ position, turn @ normal)
        assert turned == pytest.approx(irradiance(light, position, normal), rel=1e-10, abs=0)


def mean_irradiance(a, b):
    """Mean over rectangle b, which faces the light a, by Gauss' rule on the closed form."""
    x, w = np.polynomial.legendre.leggauss(24)
    x, w = (x + 1) / 2, w / 2
    points = np.asarray(b.corner) + x[:, None, None] * b.edge_u + x[None, :, None] * b.edge_v
    return np.einsum("i,j,ij->", w, w, irradiance(a, points, b.normal))


def test_form_factors_are_reciprocal():
    """A1 F12 = A2 F21 for two rectangles; each side integrates the other's closed form."""
    one = RectangleLight([0, 0, 0], [1.5, 0, 0], [0, 0.8, 0])
    two = RectangleLight([0.3, 0.2, 1.6], [0, 1.1, 0.2], [0.9, 0, 0])
    one_to_two = 0.9 * np.hypot(1.1, 0.2) * mean_irradiance(one, two)
    assert one_to_two == pytest.approx(1.5 * 0.8 * mean_irradiance(two, one), rel=1e-12, abs=0)
    assert one_to_two > 0.1


def test_directly_opposed_rectangles():
    """Howell's catalog C-11; 0.4756 for 1 x 1.5, 0.5 apart: EES after Siegel & Howell, 4th ed., p. 843.

    https://fchartsoftware.com/ees/heat_transfer_library/shape_factors/hs201.htm
    """
    a, b, c = 1.0, 1.5, 0.5
    below = RectangleLight([0, 0, 0], [a, 0, 0], [0, b, 0])
    above = RectangleLight([0, 0, c], [0, b, 0], [a, 0, 0])
    factor = mean_irradiance(below, above) / np.pi
    x, y = a / c, b / c
    p, q = np.hypot(1, x), np.hypot(1, y)
    parts = np.log(p * q / np.sqrt(1 + x * x + y * y)) - x * np.arctan(x) - y * np.arctan(y)
    parts += x * q * np.arctan(x / q) + y * p * np.arctan(y / p)
    assert factor == pytest.approx(2 / (np.pi * x * y) * parts, rel=1e-10, abs=0)
    assert factor == pytest.approx(0.4756, abs=5e-5)


def test_solid_angle_of_a_cube_is_the_whole_sphere():
    rng = np.random.default_rng(5)
    for _ in range(10):
        p = rng.uniform(-0.99, 0.99, 3)
        total = 0.0
        for axis in range(3):
            u, v, w = (np.roll(np.eye(3)[0] * 1.0, axis + i) for i in range(3))
            total += solid_angle(RectangleLight(-w - u - v, 2 * u, 2 * v), p)
            total += solid_angle(RectangleLight(w - u - v, 2 * v, 2 * u), p)
        assert total == pytest.approx(4 * np.pi, rel=1e-13, abs=0)


def test_irradiance_in_a_cube_is_pi():
    rng = np.random.default_rng(6)
    for _ in range(10):
        p, n, total = rng.uniform(-0.9, 0.9, 3), rng.normal(size=3), 0.0
        for axis in range(3):
            u, v, w = (np.roll(np.eye(3)[0] * 1.0, axis + i) for i in range(3))
            total += irradiance(RectangleLight(-w - u - v, 2 * u, 2 * v), p, n)
            total += irradiance(RectangleLight(w - u - v, 2 * v, 2 * u), p, n)
        assert total == pytest.approx(np.pi, rel=1e-13, abs=0)


@pytest.mark.parametrize(
    ("position", "radius"),
    [
        ([0, 0, 1], 1),
        ([0.7, 0, 0.1], 1),
        ([1.5, 0, 0.3], 1),
        ([3, 0, 1e-3], 1),
        ([5e5, 0, 3e5], 1),
        ([0, 0, 1e-4], 1),
        ([0.99, 0, 1e-3], 1),
        ([1.01, 0, 1e-3], 1),
    ],
)
def test_solid_angle_of_a_disk_in_40_digits(position, radius):
    rho, h = position[0], position[2]
    with mpmath.workdps(40):
        # About the receiver's foot, with the distance to it integrated out.
        rho, h = mpmath.mpf(rho), mpmath.mpf(h)

        def integrand(phi):
            s2 = rho**2 + radius**2 - 2 * rho * radius * mpmath.cos(phi)
            r = mpmath.sqrt(s2 + h**2)
            return (radius**2 - rho * radius * mpmath.cos(phi)) / (r * (r + h))

        bounds = [0, *(mpmath.mpf(10) ** e for e in (-4, -3, -2, -1, 0)), mpmath.pi]
        expected = float(2 * mpmath.quad(integrand, bounds))
    assert solid_angle(DiskLight([0, 0, 0], UP, radius), position) == pytest.approx(
        expected, rel=1e-12, abs=0
    )


def test_solid_angle_of_a_disk_on_its_axis_is_a_cone():
    h = np.geomspace(1e-3, 1e8, 60)
    found = solid_angle(DiskLight([0, 0, 0], UP, 1.0), h[:, None] * UP)
    assert found == pytest.approx(cone_solid_angle(np.arctan2(1.0, h)), rel=1e-12, abs=0)


def test_reflected_radiance_by_area_and_its_weight():
    """A lobe over a light that fills it: a sphere seen at half-angle close to 90 degrees."""
    outgoing = np.array([0.3, 0.1, np.sqrt(0.9)])
    brdf = modified_phong(0.7, 40.0)
    light = SphereLight([-0.3 * 4, -0.1 * 4, 4 * np.sqrt(0.9)], 3.9)
    found = irradiance_by_area(light, [0, 0, 0], UP, weight=lambda w: brdf(w, outgoing))
    plain = irradiance_by_area(light, [0, 0, 0], UP, weight=lambda w: np.full(w.shape[:-1], 2.0))
    assert found.converged
    assert plain.value == pytest.approx(2.0 * irradiance(light, [0, 0, 0], UP), rel=1e-11, abs=0)
    # What the sphere leaves dark is more than 77 degrees off the lobe: cos^40 < 1e-26.
    assert found.value == pytest.approx(
        outgoing_radiance(brdf, lambda w: np.ones(w.shape[:-1]), outgoing).value, rel=1e-9, abs=0
    )


def test_receivers_broadcast():
    light = RectangleLight([0, 0, 1], [0, 1, 0], [1, 0, 0])
    positions = np.random.default_rng(8).normal(size=(4, 1, 3)) * 0.3
    normals = np.random.default_rng(9).normal(size=(5, 3))
    for source in (light, DiskLight([0, 0, 2], -UP, 0.5), SphereLight([0, 0, 3], 0.5)):
        grid = irradiance(source, positions, normals)
        assert grid.shape == (4, 5)
        assert grid[2, 3] == pytest.approx(irradiance(source, positions[2, 0], normals[3]), rel=1e-14, abs=0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: RectangleLight([0, 0, 0], [1, 0, 0], [1, 1, 0]), "perpendicular"),
        (lambda: DiskLight([0, 0, 0], [0, 0, 0], 1.0), "zero vector"),
        (lambda: DiskLight([0, 0, 0], [0, 0, 1], 0.0), "radius"),
        (lambda: SphereLight([0, 0, 0], 1.0, -1.0), "radiance"),
        (lambda: irradiance(SphereLight([0, 0, 0], 1.0), [0, 0, 0.5], UP), "inside the sphere"),
        (lambda: solid_angle(SphereLight([0, 0, 0], 1.0), [np.nan, 0, 0.5]), "finite"),
    ],
)
def test_bad_lights_say_what_to_mend(call, message):
    with pytest.raises(ValueError, match=message):
        call()
