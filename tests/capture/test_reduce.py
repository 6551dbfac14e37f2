"""Bins against one pixel at a time, with the geometry of the ball written as vectors."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from reflectance_fit.capture.bins import Mask, Region, Shift, SphereBins
from reflectance_fit.capture.plane_means import _over_pixels
from reflectance_fit.capture.raw import Plane, RawFrame
from reflectance_fit.capture.reduce import reduce_frame
from reflectance_fit.data_synthetic.sensor import Sensor, expose, fixed_pattern

WIDTH, HEIGHT = 50, 38
PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG")
BLACK = np.array([[100.0, 105.5], [90.0, 111.25]])
WHITE = 4000.0
EDGES = tuple(np.radians([8.0, 20.0, 31.0, 45.0, 70.0]))
SECTORS = 6


def raw(pattern="GRBG", noise_profile=None, cfa=None):
    generator = np.random.default_rng(3)
    if cfa is None:
        # A fifth of the pixels is clipped.
        cfa = np.minimum(generator.integers(80, 5000, (HEIGHT, WIDTH)), 4000).astype(np.uint16)
    names = np.full((2, 2), "mono") if pattern == "MONO" else np.array(list(pattern)).reshape(2, 2)
    return of_cell(cfa, names, BLACK, WHITE, noise_profile)


def of_cell(cfa, names, black, white, noise_profile=None, axes_deg=None):
    axes = np.full(names.shape, np.nan) if axes_deg is None else np.asarray(axes_deg, dtype=float)
    whites = np.full(names.shape, white)
    return RawFrame(cfa, names, axes, black, whites, Fraction(1, 8), 100.0, noise_profile)


def one_by_one(frame, bin_of):
    """{(plane, bin): [pixels, clipped, sum of DN, then sums of the angles' functions]}."""
    sums = {}
    for y in range(frame.cfa.shape[0]):
        for x in range(frame.cfa.shape[1]):
            where = bin_of(x, y)
            if where is None:
                continue
            number, angles = where
            black = frame.black[y % 2, x % 2]
            dn = float(frame.cfa[y, x])
            clipped = dn - black >= 0.98 * (WHITE - black)
            row = sums.setdefault(
                (Plane(str(frame.channels[y % 2, x % 2])), number), np.zeros(3 + len(angles))
            )
            row += np.array([1, clipped, dn - black, *angles])
    return sums


@pytest.mark.parametrize("pattern", [*PATTERNS, "MONO"])
@pytest.mark.parametrize(
    "region", [(0, 0, 50, 38), (3, 5, 22, 30), (4, 7, 5, 38), (11, 2, 50, 3), (30, 20, 99, 99)]
)
def test_regions(pattern, region):
    x0, y0, x1, y1 = region
    frame = raw(pattern)
    means = reduce_frame(frame, (Region(*region),)).over(Region(*region))
    expected = one_by_one(frame, lambda x, y: (0, ()) if x0 <= x < x1 and y0 <= y < y1 else None)
    for name, plane in means.items():
        pixels, clipped, total = expected.get((name, 0), np.zeros(3))
        assert plane.pixels == [pixels]
        assert plane.saturated == [clipped]
        if pixels:
            assert plane.mean == pytest.approx([total / pixels], abs=1e-9)
        else:
            assert np.isnan(plane.mean)
        assert np.isnan(plane.theta)
    assert set(means) == ({Plane("mono")} if pattern == "MONO" else set(map(Plane, "RGB")))
    assert sum(plane.saturated[0] for plane in means.values()) > 0


def test_no_region_is_all_of_the_sensor():
    planes = reduce_frame(raw(), (Region(),)).over(Region())
    assert sum(plane.pixels[0] for plane in planes.values()) == WIDTH * HEIGHT


def sphere_bin(bins):
    ax, ay = math.cos(bins.analyzer), math.sin(bins.analyzer)

    def bin_of(x, y):
        right, up = x - bins.center_x, bins.center_y - y
        r = math.hypot(right, up)
        if r >= bins.radius:
            return None
        theta = math.asin(r / bins.radius)
        ring = [i for i in range(len(bins.edges) - 1) if bins.edges[i] <= theta < bins.edges[i + 1]]
        if not ring:
            return None
        sx, sy = -up / r, right / r
        c, s = ax * sx + ay * sy, sx * ay - sy * ax  # of the angle from s to the analyzer
        sector = int(math.atan2(s, c) % math.pi / math.pi * bins.sectors) % bins.sectors
        # The area of a pixel has a test of its own.
        means = _over_pixels(np.array(theta), np.array(math.atan2(s, c)), 1 / bins.radius)
        return ring[0] * bins.sectors + sector, tuple(map(float, means))

    return bin_of


@pytest.mark.parametrize("radius", [150.0, 400.0])
@pytest.mark.parametrize("theta_deg", [10.0, 30.0, 55.0, 70.0])
def test_a_pixel_of_a_ball_is_a_square(radius, theta_deg):
    """Against 40 x 40 points of the pixel; the next order is the fourth."""
    middle = radius * math.sin(math.radians(theta_deg)) * np.array([math.cos(0.7), math.sin(0.7)])
    offset = (np.arange(40) + 0.5) / 40 - 0.5
    x, y = (middle[0] + offset)[None], (middle[1] + offset)[:, None]
    theta, phi = np.arcsin(np.hypot(x, y) / radius), 0.4 - np.arctan2(y, x)
    expected = [np.mean(values) for values in (theta, theta**2, np.cos(2 * phi), np.sin(2 * phi))]
    point = np.radians(theta_deg), np.array(0.4 - 0.7)
    found = _over_pixels(*point, 1 / radius)
    corrected = np.abs(np.array(found) - expected)
    naive = np.abs(np.array(_over_pixels(*point, 0.0)) - expected)
    assert (corrected < 0.02 * naive).all()


@pytest.mark.parametrize("pattern", [*PATTERNS, "MONO"])
@pytest.mark.parametrize(
    ("centre", "radius", "analyzer_deg"),
    [
        ((24.3, 18.6), 17.2, 0.0),
        ((25.0, 17.0), 16.0, 40.0),  # the centre on a pixel
        ((21.7, 20.1), 15.4, 117.0),
        ((2.2, 35.4), 20.3, -30.0),  # beyond the edges
        ((-60.0, -80.0), 20.0, 0.0),  # all outside
        ((900.0, 900.0), 20.0, 0.0),
        ((24.3, 18.6), 300.0, 90.0),  # larger than the picture
    ],
)
def test_spheres(pattern, centre, radius, analyzer_deg):
    frame = raw(pattern)
    bins = SphereBins(*centre, radius, math.radians(analyzer_deg), EDGES, SECTORS)
    means = reduce_frame(frame, (bins,)).over(bins)
    expected = one_by_one(frame, sphere_bin(bins))
    for name, plane in means.items():
        for number in range((len(EDGES) - 1) * SECTORS):
            row = expected.get((name, number), np.zeros(7))
            found = [
                getattr(plane, n)[number] for n in ("mean", "theta", "theta_squared", "cos_2phi", "sin_2phi")
            ]
            assert plane.pixels[number] == row[0]
            assert plane.saturated[number] == row[1]
            if row[0]:
                assert found == pytest.approx(list(row[2:] / row[0]), abs=1e-9)
            else:
                assert np.isnan(found).all()


def test_several_bins_of_one_frame_stay_apart():
    first, second = Region(0, 0, 10, 10), Region(10, 10, 20, 20)
    means = reduce_frame(raw(), (first, second))
    assert means.over(second)[Plane("R")].mean != means.over(first)[Plane("R")].mean
    assert means.over(second)[Plane("R")].mean == reduce_frame(raw(), (second,)).over(second)[Plane("R")].mean


def test_the_noise_profile_in_dn():
    profile = {"R": (1e-4, 1e-6), "G": (2e-4, 2e-6), "B": (3e-4, 0.0)}
    noise = reduce_frame(raw("GRBG", profile), (Region(),)).noise
    spans = {"R": 4000 - 105.5, "G": 4000 - (100 + 111.25) / 2, "B": 4000 - 90.0}
    for name, (slope, floor) in profile.items():
        assert noise[name] == pytest.approx((slope * spans[name], floor * spans[name] ** 2))
    assert reduce_frame(raw(), (Region(),)).noise is None


def test_scatter_of_a_flat_is_noise_and_response_without_falloff():
    sensor = Sensor(width=400, height=320, prnu=0.01, dsnu_dn=0.0, background_e_per_s=0.0, read_noise_e=5.0)
    generator = np.random.default_rng(5)
    pixels = fixed_pattern(sensor, generator)
    exposure = Fraction(1, 2000)
    cfa = expose(np.full((1, 1), 0.8, dtype=np.float32), exposure, sensor, pixels, generator)
    names = np.array(list(sensor.pattern)).reshape(2, 2)
    frame = of_cell(cfa, names, np.array(sensor.black, dtype=float), 15871.0)
    for (name, _), (mean, variance) in reduce_frame(frame, (Region(),)).scatter.items():
        middle = np.ma.masked_all(cfa.shape)
        for y in range(80, 240):
            for x in range(100, 300):
                if names[y % 2, x % 2] == name:
                    middle[y, x] = float(cfa[y, x]) - sensor.black[y % 2][x % 2]
        expected = mean / 2.2 + (5.0 / 2.2) ** 2 + 1 / 12 + (0.01 * mean) ** 2
        assert mean == pytest.approx(middle.mean(), rel=0.003)
        # 8000 pixels, of pairs that share one: 5 sigma.
        assert variance == pytest.approx(expected, rel=5 * math.sqrt(3 / 8000))


AXES = [[90.0, 45.0], [135.0, 0.0]]


@pytest.mark.parametrize("colour", [False, True])
def test_a_polarizer_on_each_pixel_is_a_plane_of_its_own(colour):
    names = np.array([list("RRGG"), list("RRGG"), list("GGBB"), list("GGBB")])
    n = 4 if colour else 2
    cells = names if colour else np.full((2, 2), "mono")
    black = np.arange(100.0, 100.0 + n * n).reshape(n, n)
    generator = np.random.default_rng(8)
    cfa = generator.integers(80, 5000, (HEIGHT, WIDTH)).astype(np.uint16)
    frame = of_cell(cfa, cells, black, 5000.0, axes_deg=np.tile(AXES, (n // 2, n // 2)))
    ball = SphereBins(24.3, 18.6, 17.2, None, EDGES, SECTORS)
    region = Region(3, 5, 41, 30)
    means = reduce_frame(frame, (region, ball))
    for (channel, axis_deg), plane in means.over(region).items():
        own = [
            float(cfa[y, x]) - black[y % n, x % n]
            for y in range(5, 30)
            for x in range(3, 41)
            if cells[y % n, x % n] == channel and AXES[y % 2][x % 2] == axis_deg
        ]
        assert plane.pixels == [len(own)]
        assert plane.mean == pytest.approx([np.mean(own)], abs=1e-9)
        # On a ball: as if all pixels had the one axis and those of the others did not count.
        alike = replace(ball, analyzer=math.radians(axis_deg))
        others = np.ones(cfa.shape, dtype=bool)
        for y, x in ((y, x) for y in range(n) for x in range(n)):
            if cells[y, x] == channel and AXES[y % 2][x % 2] == axis_deg:
                others[y::n, x::n] = False
        single = replace(frame, channels=np.full((n, n), "mono"), axes_deg=np.full((n, n), np.nan))
        alone = reduce_frame(single, (alike,), mask=Mask.of(others)).over(alike)[Plane("mono")]
        for name in ("pixels", "saturated", "mean", "theta", "cos_2phi"):
            np.testing.assert_allclose(
                getattr(means.over(ball)[Plane(channel, axis_deg)], name), getattr(alone, name), rtol=1e-12
            )
    assert len(means.over(region)) == (12 if colour else 4)


@pytest.mark.parametrize("bins", [Region(3, 5, 41, 30), SphereBins(24.3, 18.6, 17.2, 0.3, EDGES, SECTORS)])
def test_a_mask_takes_pixels_out_of_every_sum(bins):
    frame = raw()
    masked = np.random.default_rng(4).random(frame.cfa.shape) < 0.3
    junk = replace(frame, cfa=np.where(masked, 4000, frame.cfa).astype(np.uint16))
    found, clean = (reduce_frame(f, (bins,), mask=Mask.of(masked)).over(bins) for f in (junk, frame))
    everything = reduce_frame(frame, (bins,)).over(bins)
    for plane in found:
        np.testing.assert_array_equal(found[plane].mean, clean[plane].mean)
        assert 0 < found[plane].pixels.sum() < everything[plane].pixels.sum()


@pytest.mark.parametrize("bins", [Region(13, 9, 31, 26), SphereBins(24.0, 18.0, 11.0, 0.3, EDGES, SECTORS)])
@pytest.mark.parametrize("turn_deg", [0.0, 180.0])
def test_a_moved_picture_gives_the_same_means(bins, turn_deg):
    # By whole cells, or upside down about a point between pixels, the same pixels are seen elsewhere.
    frame = raw("MONO")
    frame = replace(frame, black=np.zeros((2, 2)))
    if turn_deg:
        moved = replace(frame, cfa=frame.cfa[::-1, ::-1])
        shift = Shift(((-1.0, 0.0), (0.0, -1.0)), (WIDTH - 1.0, HEIGHT - 1.0))
    else:
        moved = replace(frame, cfa=np.roll(frame.cfa, (4, 6), axis=(0, 1)))
        shift = Shift(offset=(6.0, 4.0))
    expected = reduce_frame(frame, (bins,)).over(bins)[Plane("mono")]
    found = reduce_frame(moved, (bins,), shift=shift).over(bins)[Plane("mono")]
    np.testing.assert_array_equal(found.pixels, expected.pixels)
    np.testing.assert_allclose(found.mean, expected.mean, rtol=1e-12)
    np.testing.assert_allclose(found.theta, expected.theta, rtol=1e-12)
