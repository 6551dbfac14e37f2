"""Rows of adjoint rays against the Mueller matrices of physics, and frames against geometry."""

import numpy as np
import pytest
from render_lanes import over_lanes

from reflectance_fit.physics import mueller
from reflectance_fit.physics.fresnel import amplitudes
from reflectance_fit.render.lobes import mueller as rows

N = 500
RNG = np.random.default_rng(7)
ROWS = RNG.normal(size=(4, N))
DTYPES = (np.float64, np.float32)


def units(rng, n):
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def across(rng, z):
    """Unit vectors at right angles to z."""
    v = np.cross(z, units(rng, len(z)))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def times(row, matrix):
    return np.einsum("in,nij->jn", row, matrix)


@pytest.mark.parametrize("dtype", DTYPES)
def test_the_angle_between_axes_is_counter_clockwise_for_the_receiver(dtype):
    z = units(RNG, N)
    s = across(RNG, z)
    angle = RNG.uniform(-np.pi, np.pi, N)
    # From s towards p = z x s, as docs/conventions.md has it.
    turned = np.cos(angle)[:, None] * s + np.sin(angle)[:, None] * np.cross(z, s)
    got = over_lanes(rows.double_angle, *s.T, *turned.T, *z.T, dtype=dtype)
    near = 10 * np.finfo(dtype).eps
    assert np.abs(got - [np.cos(2 * angle), np.sin(2 * angle)]).max() <= near
    assert np.abs(np.hypot(*got) - 1).max() <= near


def test_a_turned_row_gives_the_same_of_turned_light():
    angle = RNG.uniform(-np.pi, np.pi, N)
    stokes = RNG.normal(size=(4, N))
    r1, r2 = over_lanes(rows.turn, ROWS[1], ROWS[2], np.cos(2 * angle), np.sin(2 * angle))
    seen = np.einsum("nij,jn->in", mueller.rotator(angle), stokes)
    now = ROWS[0] * seen[0] + r1 * seen[1] + r2 * seen[2] + ROWS[3] * seen[3]
    assert now == pytest.approx(np.sum(ROWS * stokes, axis=0), abs=1e-13)


def test_rows_meet_the_matrices_of_reflection_polarizer_and_retarder():
    c, eta, k = RNG.uniform(0, 1, N), RNG.uniform(0.2, 3, N), RNG.uniform(0, 5, N)
    matrix = mueller.reflection(*amplitudes(c, eta, k))
    block = (matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 2, 2], matrix[:, 3, 2])
    assert over_lanes(rows.reflect, *ROWS, *block) == pytest.approx(times(ROWS, matrix), abs=1e-14)
    d = RNG.uniform(0, 1, N)
    assert over_lanes(rows.polarize, *ROWS, d) == pytest.approx(
        times(ROWS, mueller.polarizer(0, d)), abs=1e-14
    )
    delay = RNG.uniform(0, 2 * np.pi, N)
    expected = times(ROWS, mueller.retarder(0.0, delay))
    got = over_lanes(rows.retard, ROWS[2], ROWS[3], np.cos(delay), np.sin(delay))
    assert got == pytest.approx(expected[2:], abs=1e-14)
    assert np.all(expected[:2] == ROWS[:2])


@pytest.mark.parametrize("dtype", DTYPES)
def test_the_s_axis_is_across_both_and_has_a_fallback(dtype):
    a, b, f = units(RNG, N), units(RNG, N), units(RNG, N)
    b[::2] = a[::2]
    got = over_lanes(rows.across, *a.T, *b.T, *f.T, dtype=dtype)
    assert pytest.approx(f[::2], abs=1e-7) == got[:, ::2].T
    n = np.cross(a, b)[1::2]
    near = 20 * np.finfo(dtype).eps / np.linalg.norm(n, axis=1).min()
    assert pytest.approx(n / np.linalg.norm(n, axis=1, keepdims=True), abs=near) == got[:, 1::2].T


def test_a_mirror_seen_along_its_normal_does_the_same_in_every_frame():
    """There the plane of incidence is anyone's choice, and the choice must not show."""
    r_s, r_p = amplitudes(1.0, 0.183, 3.43)
    matrix = mueller.reflection(r_s, r_p)
    block = (matrix[0, 0], matrix[0, 1], matrix[2, 2], matrix[3, 2])
    plain = over_lanes(rows.reflect, *ROWS, *block)
    angle = 0.7
    c, s = np.cos(2 * angle), np.sin(2 * angle)
    # The light turns back, so the same turn in space has the other sense for the light that comes.
    r1, r2 = over_lanes(rows.turn, ROWS[1], ROWS[2], c, s)
    r0, r1, r2, r3 = over_lanes(rows.reflect, ROWS[0], r1, r2, ROWS[3], *block)
    r1, r2 = over_lanes(rows.turn, r1, r2, c, s)
    assert np.array([r0, r1, r2, r3]) == pytest.approx(plain, abs=1e-13)
