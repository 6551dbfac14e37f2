"""The variables and attributes of MAP.nc: one list, from which it is written and described."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

SCHEMA = "reflectance_fit/map/1"
DIMENSIONS = ("channel", "y", "x")


class Field(NamedTuple):
    """A number for every pixel of every channel."""

    dtype: str
    unit: str
    text: str


FIELDS: Mapping[str, Field] = {
    "eta": Field("float32", "1", "refractive index relative to vacuum; NaN where status is 10 or above"),
    "eta_sigma": Field(
        "float32",
        "1",
        "one standard deviation of eta by the noise of the pixel alone; errors that all pixels share are not in it",
    ),
    "k": Field(
        "float32", "1", "extinction relative to vacuum; NaN in channels of model dielectric, where it is 0"
    ),
    "k_sigma": Field("float32", "1", "one standard deviation of k by the noise of the pixel alone"),
    "eta_k_correlation": Field("float32", "1", "correlation of eta and k"),
    "chi2": Field("float32", "1", "squared residuals over variance, summed over the readings of the pixel"),
    "dof": Field("uint16", "1", "degrees of freedom of chi2; 0: the readings cannot contradict each other"),
    "status": Field("uint8", "1", "what is known of the pixel, or why nothing is"),
}
"""Those of k are in files of which a channel has it."""

OF_K = ("k", "k_sigma", "eta_k_correlation")

COORDINATES: Mapping[str, tuple[str, str, str]] = {
    "channel": ("text", "", "name of the wavelength band"),
    "wavelength_nm": ("float64", "nm", "vacuum wavelength at the centre of the band, one a channel"),
    "y": ("float64", "1", "row of the sensor at the middle of the cell, from 0 at the top"),
    "x": ("float64", "1", "column of the sensor at the middle of the cell, from 0 at the left"),
}
FITS: Mapping[str, str] = {
    "fit_eta": "eta of a fit of all pixels together, whose nuisances correct every pixel",
    "fit_eta_sigma": "one standard deviation of fit_eta: it has the errors that all pixels share",
    "fit_k": "k of that fit; 0 where the model is dielectric",
    "fit_k_sigma": "one standard deviation of fit_k",
}
"""A number for every channel."""

ATTRIBUTES: Mapping[str, str] = {
    "Conventions": "CF-1.11",
    "schema": SCHEMA,
    "title": "what the file holds",
    "sample": "name of the sample",
    "note": "what its manifest says of the sample; absent: nothing",
    "exterior_ior": "index around the sample; eta and k are relative to vacuum all the same",
    "models": "JSON: channel to dielectric (k = 0) or conductor",
    "warnings": "JSON: list of {code, message}",
    "inputs": "JSON: list of {file, sha256}, the manifest first",
    "version": "of the program that wrote the file",
}


def map_schema() -> dict[str, Any]:
    """Dimensions, variables and attributes of the file, for people and programs that read it."""
    return {
        "title": "reflectance_fit map",
        "format": "NetCDF4",
        "dimensions": list(DIMENSIONS),
        "coordinates": {
            name: {"type": kind, "unit": unit or None, "description": text}
            for name, (kind, unit, text) in COORDINATES.items()
        },
        "variables": {
            name: {"type": kind, "unit": unit, "description": text}
            for name, (kind, unit, text) in FIELDS.items()
        },
        "by_channel": {
            name: {"type": "float64", "unit": "1", "description": text} for name, text in FITS.items()
        },
        "attributes": dict(ATTRIBUTES),
    }
