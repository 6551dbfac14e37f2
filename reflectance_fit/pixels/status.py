"""What is known of a pixel: one code each, with a meaning for the files that hold maps."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """A pixel's verdict.

    Codes below 10 are of pixels that were estimated, those from 10 on are reasons why a pixel was not; files carry
    them as CF flag_values with ``flag_meanings``.
    """

    IDENTIFIED = 0
    UPPER_LIMIT = 1
    AMBIGUOUS = 2
    NEAR_BREWSTER = 3
    NOT_IDENTIFIED = 4
    NOT_CONVERGED = 5
    OUTSIDE = 10
    MASKED = 11
    SATURATED = 12
    TOO_FEW = 13
    NO_LIGHT = 14
    TILE_LOST = 15

    @property
    def meaning(self) -> str:
        """In a sentence."""
        return _MEANINGS[self]

    @property
    def estimated(self) -> bool:
        """Whether eta and its sigma are numbers."""
        return self < Status.OUTSIDE


_MEANINGS = {
    Status.IDENTIFIED: "eta, and k where it is free, are known to within their sigma",
    Status.UPPER_LIMIT: "eta is known; k cannot be told from 0, and k + 1.645 k_sigma is its 95 % limit",
    Status.AMBIGUOUS: "another eta or k fits as well",
    Status.NEAR_BREWSTER: "R_p is lost in the noise; sigma covers both sides of Brewster's angle",
    Status.NOT_IDENTIFIED: "the interval spans more than a quarter of the prior's range",
    Status.NOT_CONVERGED: "the search did not come to rest",
    Status.OUTSIDE: "not on the sample",
    Status.MASKED: "masked by the capture or by the user",
    Status.SATURATED: "saturated in a frame that the pixel needs",
    Status.TOO_FEW: "fewer readings, or fewer different ones, than unknowns",
    Status.NO_LIGHT: "no light above the noise",
    Status.TILE_LOST: "the tile could not be computed",
}


def flag_values() -> tuple[int, ...]:
    """The codes in rising order, for the CF attribute of this name."""
    return tuple(int(status) for status in Status)


def flag_meanings() -> str:
    """Their names, one word each, separated by spaces as CF has them."""
    return " ".join(status.name.lower() for status in Status)
