"""Where the state of a block of rays lies: one array of floats, one of 32-bit integers, a field after the other.

``F[OX + j]`` is field OX of lane j.  All offsets and the number of lanes are
constants, from which the compiler sees that fields do not overlap.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.physics.jit import vectorised

# numba takes these as types, mypy must not.
u32: Any = np.uint32
i32: Any = np.int32

LANES = 128
_B = LANES

# Ray, distance of what it meets, and the density by which its direction was drawn (0: no choice).
OX, OY, OZ, DX, DY, DZ = (k * _B for k in range(6))
FAR, DENSITY = 6 * _B, 7 * _B
# Where it meets, the normal there, towards the outside.
PX, PY, PZ, NX, NY, NZ = (k * _B for k in range(8, 14))
# Towards the sampled light: direction, distance, density (0: it has no size), and whether it is seen.
LX, LY, LZ, REACH, LIT, SEEN = (k * _B for k in range(14, 20))
# What is left of a ray when radiance is squeezed by indices; where a ray goes on behind a sheet.
SQUEEZE, BEYOND = 20 * _B, 21 * _B
# Axis that polarization refers to; of the sampled light's.
AX, AY, AZ, BX, BY, BZ = (k * _B for k in range(22, 28))
# Wavelengths (nm) and one over their densities; position on a texture.
WAVE, SHARE = 28 * _B, 32 * _B
TU, TV = 36 * _B, 37 * _B
# Radiance of the sampled light over its density, and its Stokes vector over S0.
EMIT = 38 * _B
# 1 where a dispersive interface has left the first wavelength alone.
ALONE = 42 * _B
# What a texture shows.
PAINT = 43 * _B
# Stokes vector of the sampled light over S0, behind sheets.
STATE_1, STATE_2, STATE_3 = 47 * _B, 48 * _B, 49 * _B
# Rows: channel by channel, row by row, component by component; then what they gathered.
ROWS = 50 * _B

# What a surface makes of the lanes in LIST, side by side, before it goes back to them: direction, normal or axis,
# density, squeeze, and for each channel a factor or the block of a Mueller matrix (or whole rows).
QX, QY, QZ, QA, QB, QC, Q_DENSITY, Q_SQUEEZE, Q_ALONE = (k * _B for k in range(9))
Q_FACTOR = 9 * _B
Q_LIGHT = (9 + 4 * 4 * 4) * _B
QUEUE = (9 + 4 * 4 * 4 + 4 * 4) * _B

# Integers: pixel, its number in the tile, keys of random numbers, rays so far, state,
STATE, COLUMN, LINE, SLOT, KEY, SAMPLE, DEPTH = (k * _B for k in range(7))
# the shape met and the one the ray left, what is there, the light chosen and its shape, and a list of lanes.
MET, LEFT, KIND, LIGHT, TARGET, LIST = (k * _B for k in range(7, 13))
INTEGERS = 13 * _B

# Cells of equal chance from which wavelengths are drawn.
QUANTILES = 256

RUNNING, DONE, IDLE = 0, 1, 2

# Pairs of random numbers for each ray of a path: light, direction, choices, roulette, and two for a picture of the surroundings.
DRAWS = 6

NOTHING = 0xFFFFFFFF
# Masks of lanes, shapes and curves: a gather is twice as fast when its indices are known to be small.
LAST, MOST = LANES - 1, 0xFFFF
# What a ray can meet.
MISS, LAMP, DIFFUSE, GLASS, MIRROR, ROUGH_MIRROR, ROUGH_GLASS, COAT, POLARIZER, RETARDER, ASLEEP = range(11)

# One shape: centre, normal (0: sphere), edges over their squared length, squared radius, where it is in four numbers,
SHAPE = 24
CENTER, NORMAL, EDGE_U, EDGE_V, RADIUS2, PLACE, ALPHA, M0, M1, M2, M3 = (
    0, 3, 6, 9, 12, 13, 17, 18, 19, 20, 21,
)  # fmt: skip
# and kind, curves of eta, k and reflectance, light, texture.
SHAPE_IDS = 10
OF_KIND, OF_ETA, OF_K, OF_COLOUR, OF_LIGHT, OF_TEXTURE, OF_R0, OF_B, OF_A, OF_POWER = range(10)

# Of so few shapes each lane's is found sooner by asking for every one of them than by a gather.
FEW = 8

# One light: position or direction, normal, half edges, area or radius, how often it is chosen, alias table, Stokes vector, axis.
LAMPS = 24
AT, TURNED, HALF_U, HALF_V, SIZE, CHOSEN, KEEP, POLARIZED, AXIS = 0, 3, 6, 9, 12, 13, 14, 15, 18
LAMP_IDS = 4
LAMP_KIND, LAMP_SHAPE, LAMP_CURVE, LAMP_ALIAS = range(4)
POINT, DIRECTIONAL, FLAT, ROUND, BALL, IMAGE = range(6)


Floats = NDArray[Any]
Words = NDArray[np.uint32]


class Has(NamedTuple):
    """What a scene contains: tuples, because their lengths are known when a kernel is compiled."""

    channels: tuple[int, ...]
    rows: tuple[int, ...]  # of the Mueller matrix, 1 or 4; none: not polarized
    spectral: tuple[int, ...]
    sobol: tuple[int, ...]
    lamps: tuple[int, ...]  # lights that are sampled: none, one, or two for many
    area: tuple[int, ...]  # with an area: none, one, or two where some are balls
    points: tuple[int, ...]  # without
    polarized: tuple[int, ...]  # any of them, or the surroundings
    refracting: tuple[int, ...]
    sheets: tuple[int, ...]
    textures: tuple[int, ...]
    dispersive: tuple[int, ...]
    few: tuple[int, ...]  # shapes: no more than FEW
    approximate: tuple[int, ...]  # one: r0, b, a and power 6; two: by eta and k; three: any power


class Parts(NamedTuple):
    """Parts of the transport that a scene needs; None keeps numba from even looking at a part."""

    lamps: int | None
    image: int | None
    textures: int | None
    glass: int | None
    metal: int | None
    rough_metal: int | None
    rough_glass: int | None
    coat: int | None
    sheets: int | None


class Tables(NamedTuple):
    """The scene as arrays."""

    shapes: Any
    shape_ids: Any
    lamps: Any
    lamp_ids: Any
    curves: Any
    camera: Any
    spectra: Any  # quantiles of the wavelengths, and the observer's three curves
    paint: Any  # pixels of textures
    paint_ids: Any  # for each its first number, width and height
    sky: Any  # picture of the surroundings: see ``sky``
    sky_ids: Any
    counts: Any


# Entries of ``counts``: shapes of each kind, lights that are sampled, the picture's size and its light, and the curves that
# three primaries stand for, of surfaces and of the surroundings.
SPHERES, RECTANGLES, DISKS, PLANES, SAMPLED, SKY_WIDTH, SKY_HEIGHT, SKY_LAMP, PRIMARIES, SKY_PRIMARIES = (
    0, 1, 2, 3, 4, 5, 6, 7, 8, 11,
)  # fmt: skip
COUNTS = 14


def floats(has: Has) -> int:
    """How long the array of floats must be."""
    entries = max(len(has.rows), 1)
    components = 4 if has.rows else 1
    return ROWS + len(has.channels) * entries * (components + 1) * LANES


@vectorised
def row_count(has: Has) -> int:
    return len(has.rows) if len(has.rows) > 0 else 1


@vectorised
def components(has: Has) -> int:
    return 4 if len(has.rows) > 0 else 1


@vectorised
def row(has: Has, channel: int, entry: int, component: int) -> int:
    """Offset of one number of a row."""
    return ROWS + ((channel * row_count(has) + entry) * components(has) + component) * LANES


@vectorised
def gathered(has: Has, channel: int, entry: int) -> int:
    """Offset of what a row has gathered."""
    before = len(has.channels) * row_count(has) * components(has)
    return ROWS + (before + channel * row_count(has) + entry) * LANES


def integers() -> Words:
    return np.zeros(INTEGERS, np.uint32)
