"""The columns and attributes of OBS.nc: one list, from which it is written, read and described."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from reflectance_fit.observations import Flag, Quantity

SCHEMA = "reflectance_fit/observations/1"

Kind = Literal["text", "float", "integer"]

# name -> (kind, unit, description)
COLUMNS: Mapping[str, tuple[Kind, str, str]] = {
    "channel": ("text", "", "name of the wavelength band"),
    "wavelength_nm": ("float", "nm", "vacuum wavelength at its centre"),
    "set": ("text", "", "rows of equal set and theta_deg share one setting of the goniometer"),
    "gain_group": ("text", "", "rows of one group share one unknown gain; empty: absolute"),
    "theta_deg": ("float", "degree", "angle of incidence from the normal, 0 to below 90"),
    "theta_deg_sigma": ("float", "degree", "one standard deviation of theta_deg; 0: exact"),
    "theta_deg_spread": (
        "float",
        "degree",
        "standard deviation of the angle over the row's pixels; 0: one angle",
    ),
    "analyzer_deg": ("float", "degree", "transmission axis, counter-clockwise from s; NaN: no analyzer"),
    "retarder_deg": ("float", "degree", "fast axis, counter-clockwise from s; NaN: no retarder"),
    "retardance_deg": ("float", "degree", "retardance; NaN: no retarder"),
    "diattenuation": ("float", "1", "of the analyzer, above 0 to 1; 1: ideal"),
    "light_s0": ("float", "1", "incident Stokes vector in the (s, p) frame: power"),
    "light_s1": ("float", "1", "the same: s over p"),
    "light_s2": ("float", "1", "the same: +45 degrees, from s towards p, over -45"),
    "light_s3": ("float", "1", "the same: right over left circular"),
    "quantity": ("text", "", f"one of {', '.join(Quantity)}"),
    "value": ("float", "", "degrees for psi_deg and delta_deg, any unit for signals, else 1"),
    "sigma": ("float", "", "one standard deviation of value, in its unit; NaN: not stated"),
    "pixels": ("integer", "1", "number of pixels averaged"),
    "flag": ("text", "", f"one of {', '.join(Flag)}"),
    "fwhm_nm": ("float", "nm", "full width at half maximum of the wavelength band; 0: a line"),
    "signal_per_dn": ("float", "", "what one raw count adds to value; NaN: there are no counts"),
}
# Absent from the files of the first version.
OPTIONAL = ("fwhm_nm", "signal_per_dn")
ATTRIBUTES: Mapping[str, str] = {
    "schema": SCHEMA,
    "sample": "name of the sample",
    "note": "what its manifest says of the sample; absent: nothing",
    "exterior_ior": "index around the sample",
    "nuisances": "JSON: name to the sigma of its prior, null for flat; absent: none",
    "common_sigmas": "JSON: nuisance to the sigma measured of it, by channel; absent: none was",
    "priors": "JSON: eta and k, as in the block of manifests",
    "warnings": "JSON: list of {code, message}",
    "inputs": "JSON: list of {file, sha256}, the manifest first",
    "version": "of the program that wrote the file",
}


def observations_schema() -> dict[str, Any]:
    """Columns and attributes of the file, for people and programs that read it."""
    return {
        "title": "reflectance_fit observations",
        "format": "NetCDF4",
        "dimension": "row",
        "columns": {
            name: {"type": kind, "unit": unit or None, "description": text}
            for name, (kind, unit, text) in COLUMNS.items()
        },
        "attributes": dict(ATTRIBUTES),
    }
