"""A camera's sensor: from light to the numbers of a RAW file, with the faults of real ones.

    DN = round(clip(black + dsnu + (min(Poisson(e), full well) + N(0, read)) / gain, 0, white))
    e  = (radiance * sensitivity * falloff + background) * prnu * exposure

after EMVA Standard 1288.  The well fills before the read noise comes in, and
values below black are kept.  PRNU, DSNU and falloff belong to the camera and
are the same in every frame; shot and read noise are fresh in each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reflectance_fit.errors import ReflectanceFitError

FloatArray = NDArray[np.float32]
Pattern = Literal["RGGB", "BGGR", "GRBG", "GBRG", "MONO"]
Layout = tuple[tuple[float, float], tuple[float, float]]

COLOURS = "RGB"
MONO = "mono"
EXPOSURES_S = (
    *(Fraction(1, n) for n in (8000, 4000, 2000, 1000, 500, 250, 125, 60, 30, 15, 8, 4, 2, 1)),
    Fraction(2),
)
"""What can be set, about one stop apart: few values, so that few darks serve them all."""

# Of the range to the clip point: a stop below it holds 40 %, and PRNU and shot noise never reach it.
_TARGET = 0.8
# Electrons above which shot noise is drawn as normal.
BRIGHT_E = 50.0
_RARE = 1.0  # events a pixel
_FAR = 10.0  # standard deviations that no pixel strays


class Site(NamedTuple):
    """One position of the cell: its pixels, their colour, and the transmission axis of the polarizer on them."""

    rows: slice
    columns: slice
    colour: str
    axis_deg: float | None


@dataclass(frozen=True, slots=True)
class Sensor:
    """What a sensor does to light.

    Parameters
    ----------
    width, height : int
        Pixels, even.
    pattern : str
        Colours of the 2 x 2 cell, row by row from the top left pixel; MONO without filters.
    layout_deg : 2 x 2 float or None
        Transmission axes of polarizers on the pixels, rows from the top; under a
        colour filter stands a whole group of four.
    bits : int
        Depth of the RAW file.
    black : 2 x 2 int
        Offset in DN of each pixel of the cell.
    white : int
        DN at which the converter clips.
    gain_e_per_dn, read_noise_e, full_well_e : float
        Electrons a DN; one standard deviation; what a pixel can hold.
    prnu : float
        Spread of the pixels' response, relative, one standard deviation.
    dsnu_dn : float
        Spread of the pixels' offsets, one standard deviation.
    vignetting : float
        tan^2 of the field angle in the corner: falloff is cos^4 of the field angle.
    background_e_per_s : float
        Dark current and stray light behind the lens; in dark frames too.
    sensitivity_e_per_s : float, shape (3,)
        Electrons a second from radiance 1 in R, G and B; without filters as in G.
    """

    width: int = 1664
    height: int = 1248
    pattern: Pattern = "RGGB"
    layout_deg: Layout | None = None
    bits: Literal[12, 14, 16] = 14
    black: tuple[tuple[int, int], tuple[int, int]] = ((512, 515), (509, 511))
    white: int = 15871
    gain_e_per_dn: float = 2.2
    read_noise_e: float = 3.0
    full_well_e: float = 36000.0
    prnu: float = 0.006
    dsnu_dn: float = 0.8
    vignetting: float = 0.15
    background_e_per_s: float = 40.0
    sensitivity_e_per_s: tuple[float, float, float] = (2.4e7, 4.0e7, 2.0e7)
    iso: int = 100

    def __post_init__(self) -> None:
        if self.width % self.side or self.height % self.side:
            raise ValueError(
                f"width and height must be multiples of {self.side}: the cell is {self.side} x {self.side}"
            )
        if self.kind == "dofp_bayer" and self.pattern != "RGGB":
            raise ValueError("sensors with polarizers under colour filters are RGGB")
        if not 0 <= min(map(min, self.black)) <= max(map(max, self.black)) < self.white < 2**self.bits:
            raise ValueError("need 0 <= black < white < 2^bits")

    @property
    def kind(self) -> str:
        """As capture.yaml names it: bayer, mono, dofp or dofp_bayer."""
        if self.layout_deg is None:
            return "mono" if self.pattern == "MONO" else "bayer"
        return "dofp" if self.pattern == "MONO" else "dofp_bayer"

    @property
    def side(self) -> int:
        """Pixels a side of the cell that repeats."""
        return 4 if self.kind == "dofp_bayer" else 2

    def cell(self) -> tuple[Site, ...]:
        """The positions of the cell, row by row."""
        return tuple(self._site(row, column) for row in range(self.side) for column in range(self.side))

    def _site(self, row: int, column: int) -> Site:
        group = self.side // 2
        colour = MONO if self.pattern == "MONO" else self.pattern[2 * (row // group) + column // group]
        axis_deg = None if self.layout_deg is None else self.layout_deg[row % 2][column % 2]
        return Site(slice(row, None, self.side), slice(column, None, self.side), colour, axis_deg)

    def sensitivity_of(self, colour: str) -> float:
        """Electrons a second from radiance 1."""
        return self.sensitivity_e_per_s[COLOURS.index("G" if colour == MONO else colour)]

    @property
    def largest_e(self) -> float:
        """Electrons up to which no pixel clips, neither its well nor the converter."""
        return min(self.full_well_e, (self.white - max(map(max, self.black))) * self.gain_e_per_dn)

    @property
    def noise_profile(self) -> tuple[float, float]:
        """Slope and offset of the variance, as DNG states them: signals as fractions of white - black."""
        span = self.white - np.mean(self.black)
        read_dn2 = (self.read_noise_e / self.gain_e_per_dn) ** 2
        return float(1.0 / (self.gain_e_per_dn * span)), float((read_dn2 + 1.0 / 12.0) / span**2)


@dataclass(frozen=True, slots=True, eq=False)
class FixedPattern:
    """One camera's pixels, arrays of shape (height, width).

    ``response`` is electrons a second from radiance 1 (colour, falloff and
    PRNU), ``background`` electrons a second without light, ``offset`` the DN
    of no electrons (black and DSNU).
    """

    response: FloatArray
    background: FloatArray
    offset: FloatArray


def fixed_pattern(sensor: Sensor, generator: np.random.Generator) -> FixedPattern:
    """Draw the pixels of one camera."""
    shape = (sensor.height, sensor.width)
    prnu = 1.0 + sensor.prnu * generator.standard_normal(shape, dtype=np.float32)
    offset = sensor.dsnu_dn * generator.standard_normal(shape, dtype=np.float32)
    response = prnu * _falloff(sensor)
    for rows, columns, colour, _ in sensor.cell():
        response[rows, columns] *= sensor.sensitivity_of(colour)
        offset[rows, columns] += sensor.black[rows.start % 2][columns.start % 2]
    background = sensor.background_e_per_s * prnu
    return FixedPattern(*(array.astype(np.float32) for array in (response, background, offset)))


def expose(
    radiance: FloatArray,
    exposure_s: Fraction,
    sensor: Sensor,
    pixels: FixedPattern,
    generator: np.random.Generator | None,
) -> NDArray[np.uint16]:
    """One frame.

    Parameters
    ----------
    radiance : float, shape (height, width) or broadcastable to it
        Behind the analyzer, each pixel in its own colour; at least 0.
    exposure_s : Fraction
    generator : numpy Generator or None
        None for the expectation: neither shot nor read noise.

    Returns
    -------
    uint16, shape (height, width)
        The colour filter array, DN.
    """
    electrons = radiance * pixels.response
    electrons += pixels.background
    electrons *= np.float32(exposure_s)
    if generator is None:
        electrons = np.minimum(electrons, np.float32(sensor.full_well_e))
    else:
        electrons = _read_out(electrons, sensor, generator)
    electrons /= np.float32(sensor.gain_e_per_dn)
    electrons += pixels.offset
    np.clip(electrons, 0, sensor.white, out=electrons)
    np.rint(electrons, out=electrons)
    return electrons.astype(np.uint16)


def _read_out(electrons: FloatArray, sensor: Sensor, generator: np.random.Generator) -> FloatArray:
    """Charge of mean ``electrons`` as it is read: shot noise, full well, read noise.

    Shot noise is Poisson below BRIGHT_E, above it normal of the same mean and
    variance; what the normal lacks is the skewness, below 0.15 there.  Where the
    well cannot fill, shot and read noise are one normal of their summed variance.
    """
    noise = generator.standard_normal(electrons.shape, dtype=np.float32)
    read, well = np.float32(sensor.read_noise_e), np.float32(sensor.full_well_e)
    # In place, because a frame's size of fresh memory costs as much as the arithmetic on it.
    charge = electrons + read**2
    np.sqrt(charge, out=charge)
    charge *= noise
    charge += electrons
    dim = electrons < BRIGHT_E
    if dim.any():
        charge[dim] = _poisson(electrons[dim], generator) + read * noise[dim]
    nearly_full = well - _FAR * math.sqrt(well)
    if electrons.max() > nearly_full:
        filling = electrons > nearly_full
        mean = electrons[filling]
        shot = mean + np.sqrt(mean) * generator.standard_normal(mean.shape, dtype=np.float32)
        charge[filling] = np.minimum(shot, well) + read * noise[filling]
    return charge


def _poisson(mean: FloatArray, generator: np.random.Generator) -> FloatArray:
    """Poisson counts, shape (N,), N > 0.

    Rare events, as in a dark frame, are drawn one by one over all pixels and
    thinned to each pixel's mean: the same law, in time that goes with the events.
    """
    most = float(mean.max())
    if most > _RARE:
        return generator.poisson(mean).astype(np.float32)
    events = generator.integers(mean.size, size=generator.poisson(most * mean.size))
    kept = events[most * generator.random(events.size, dtype=np.float32) < mean[events]]
    return np.bincount(kept, minlength=mean.size).astype(np.float32)


def auto_exposure(
    radiance: FloatArray, sensor: Sensor, pixels: FixedPattern, used: tuple[slice, slice]
) -> Fraction:
    """The longest exposure that clips no used pixel: the largest signal is at 40 to 80 % where light allows."""
    rate = (radiance * pixels.response + pixels.background)[used]
    brightest = float(np.max(rate))
    fitting = [t for t in EXPOSURES_S if brightest * t <= _TARGET * sensor.largest_e]
    if not fitting:
        raise ReflectanceFitError(
            f"the shortest exposure, {EXPOSURES_S[0]} s, is still too long for {brightest:.3g} electrons a second"
        )
    return fitting[-1]


def stops_from(exposure_s: Fraction, stops: int) -> Fraction:
    """So many settings longer, or shorter where negative; the last one where there are no more."""
    at = EXPOSURES_S.index(exposure_s) + stops
    return EXPOSURES_S[min(max(at, 0), len(EXPOSURES_S) - 1)]


def _falloff(sensor: Sensor) -> FloatArray:
    """cos^4 of the field angle, 1 in the middle, shape (height, width)."""
    y, x = np.arange(sensor.height), np.arange(sensor.width)
    middle_x, middle_y = (sensor.width - 1) / 2, (sensor.height - 1) / 2
    square = ((x - middle_x) ** 2 + ((y - middle_y) ** 2)[:, None]) / (middle_x**2 + middle_y**2)
    return ((1.0 + sensor.vignetting * square) ** -2).astype(np.float32)
