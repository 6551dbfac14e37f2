"""Maps as files, a band of rows at a time: NetCDF4 with CF's attributes, and OpenEXR for pictures.

The same numbers give the same bytes: what is written in which order does not
depend on how they were computed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import h5netcdf
import numpy as np
from numpy.typing import NDArray

from reflectance_fit.files import write_whole
from reflectance_fit.map_columns import COORDINATES, DIMENSIONS, FIELDS, FITS

BAND = 256
"""Rows at a time, and the side of a chunk of the file: at 8192 columns a band takes 8 MB."""


class Source(Protocol):
    """Where the numbers are."""

    def band(self, name: str, channel: int, rows: slice) -> NDArray[Any]:
        """Some rows of a field of one channel, shape (rows, columns)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class MapHeader:
    """What a map is of.

    ``channels`` maps names to wavelengths in nm, ``y`` and ``x`` are places on
    the sensor, ``fits`` maps a name of map_columns.FITS, without its "fit_", to
    the number, for each channel, ``fields`` are names of map_columns.FIELDS, ``flags`` code and name
    of every status; ``attributes`` those of map_columns.ATTRIBUTES, what is no
    text or number as JSON.
    """

    channels: Mapping[str, float]
    y: NDArray[np.float64]
    x: NDArray[np.float64]
    fits: Sequence[Mapping[str, float]]
    fields: Sequence[str]
    flags: Mapping[int, str]
    attributes: Mapping[str, Any]

    def bands(self) -> Iterator[slice]:
        """All rows, in pieces."""
        for first in range(0, len(self.y), BAND):
            yield slice(first, min(first + BAND, len(self.y)))


def write_map(path: Path, header: MapHeader, source: Source) -> None:
    """Write the NetCDF4 file, whole or not at all."""

    def fill(part: Path) -> None:
        with h5netcdf.File(part, "w") as file:
            for name, value in header.attributes.items():
                plain = isinstance(value, str | float)
                file.attrs[name] = value if plain else json.dumps(value, ensure_ascii=False)
            file.dimensions = {"channel": len(header.channels), "y": len(header.y), "x": len(header.x)}
            _coordinates(file, header)
            for name in header.fields:
                variable = _variable(file, name, header)
                for channel in range(len(header.channels)):
                    for rows in header.bands():
                        variable[channel, rows, :] = source.band(name, channel, rows)

    write_whole(path, fill)


def _coordinates(file: h5netcdf.File, header: MapHeader) -> None:
    values = {
        "channel": np.array(list(header.channels), dtype=object),
        "wavelength_nm": np.array(list(header.channels.values())),
        "y": header.y,
        "x": header.x,
    }
    for name, (kind, unit, text) in COORDINATES.items():
        dimension = name if name in DIMENSIONS else "channel"
        dtype = h5netcdf.core.h5py.string_dtype() if kind == "text" else kind
        variable = file.create_variable(name, (dimension,), dtype)
        variable[...] = values[name]
        variable.attrs["long_name"] = text
        if unit:
            variable.attrs["units"] = unit
    for name, text in FITS.items():
        variable = file.create_variable(name, ("channel",), "float64")
        variable[...] = [fit[name.removeprefix("fit_")] for fit in header.fits]
        variable.attrs["long_name"], variable.attrs["units"] = text, "1"
    file.variables["wavelength_nm"].attrs["standard_name"] = "radiation_wavelength"
    file.variables["y"].attrs["axis"], file.variables["x"].attrs["axis"] = "Y", "X"
    # Rows run downwards, as in every picture.
    file.variables["y"].attrs["positive"] = "down"


def _variable(file: h5netcdf.File, name: str, header: MapHeader) -> Any:
    field = FIELDS[name]
    floating = field.dtype.startswith("float")
    variable = file.create_variable(
        name,
        DIMENSIONS,
        field.dtype,
        chunks=(1, min(BAND, len(header.y)), min(BAND, len(header.x))),
        compression="gzip",
        compression_opts=1,
        shuffle=True,
        fillvalue=np.float32(np.nan) if floating else None,
    )
    variable.attrs["long_name"] = field.text
    variable.attrs["units"] = field.unit
    variable.attrs["coordinates"] = "wavelength_nm"
    if name in ("eta", "k"):
        beside = [other for other in (f"{name}_sigma", "status", "chi2") if other in header.fields]
        variable.attrs["ancillary_variables"] = " ".join(beside)
    if name == "status":
        variable.attrs["flag_values"] = np.array(list(header.flags), dtype=np.uint8)
        variable.attrs["flag_meanings"] = " ".join(header.flags.values())
    return variable


def write_map_exr(path: Path, header: MapHeader, source: Source) -> None:
    """Write the fields as channels FIELD.CHANNEL of 32-bit floats ("eta.G"), whole or not at all."""
    # It takes 0.1 s to load, which --help must not.
    import Imath
    import OpenEXR

    names = {
        f"{field}.{re.sub(r'[^A-Za-z0-9_-]', '_', channel)}": (field, index)
        for field in header.fields
        for index, channel in enumerate(header.channels)
    }

    def fill(part: Path) -> None:
        about = OpenEXR.Header(len(header.x), len(header.y))
        about["channels"] = {name: Imath.Channel(Imath.PixelType(Imath.PixelType.FLOAT)) for name in names}
        about["compression"] = Imath.Compression(Imath.Compression.ZIP_COMPRESSION)
        for name, value in header.attributes.items():
            text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
            about[name] = text.encode()
        file = OpenEXR.OutputFile(str(part), about)
        try:
            for rows in header.bands():
                picture = {
                    name: source.band(field, index, rows).astype(np.float32).tobytes()
                    for name, (field, index) in names.items()
                }
                file.writePixels(picture, rows.stop - rows.start)
        finally:
            file.close()

    write_whole(path, fill)
