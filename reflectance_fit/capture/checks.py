"""What a capture.yaml may not say: what contradicts itself."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import PurePath

from reflectance_fit.capture.frames import WHITE
from reflectance_fit.capture.manifest import FrameEntry, Manifest
from reflectance_fit.errors import Problem, ReflectanceFitError, suggestion
from reflectance_fit.materials import library
from reflectance_fit.strict_yaml import Document

Place = tuple[str | int, ...]
Finding = tuple[Place, str]

BAYER = ("R", "G", "B")
NOT_RAW = frozenset(
    (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".gif", ".webp", ".heic", ".heif", ".exr", ".avif")
)


def contradictions(manifest: Manifest, document: Document) -> list[Problem]:
    """Keys that do not go together, each with its line."""
    findings = [
        *_camera(manifest),
        *_optics(manifest),
        *_geometry(manifest),
        *_region(("region",), manifest.region),
        *(finding for i, frame in enumerate(manifest.frames) for finding in _frame(manifest, i, frame)),
    ]
    if not any(frame.role == "sample" for frame in manifest.frames):
        findings.append((("frames",), "no frame shows the sample; add one with role: sample"))
    # One line a place: a wrong channel name is also a missing one.
    first: dict[Place, str] = {}
    for place, message in findings:
        first.setdefault(place, message)
    return [
        document.problem(place, f"{'.'.join(map(str, place))}: {message}") for place, message in first.items()
    ]


def _camera(m: Manifest) -> Iterator[Finding]:
    camera = m.camera
    if camera.sensor in ("bayer", "dofp_bayer"):
        for name in camera.channels:
            if name not in BAYER:
                yield ("camera", "channels", name), f"a {camera.sensor} sensor has the channels R, G and B"
    dofp = camera.sensor in ("dofp", "dofp_bayer")
    if dofp and camera.dofp_layout_deg is None:
        yield ("camera",), "dofp_layout_deg is missing; add the axes of the 2 x 2 pixels"
    elif not dofp and camera.dofp_layout_deg is not None:
        yield ("camera", "dofp_layout_deg"), "belongs to dofp sensors; remove it"
    if camera.dofp_layout_deg is not None and len(_directions(camera.dofp_layout_deg)) < 3:
        yield ("camera", "dofp_layout_deg"), "must have three different axes at least; are these degrees?"
    yield from _levels(m)
    if camera.noise:
        for key in ("gain_e_per_dn", "read_noise_e"):
            yield from _covers(m, ("camera", "noise", key), getattr(camera.noise, key))


def _levels(m: Manifest) -> Iterator[Finding]:
    """Levels and colours that files state, or do not."""
    camera = m.camera
    coloured = camera.sensor in ("bayer", "dofp_bayer")
    if camera.pattern is None and camera.encoding is not None and camera.sensor == "bayer":
        message = (
            "pattern is missing; add the colours of the top left pixels, as RGGB: PNG and TIFF do not tell"
        )
        yield ("camera",), message
    elif camera.pattern is not None and not coloured:
        yield ("camera", "pattern"), "belongs to sensors with colour filters; remove it"
    elif camera.pattern is not None and camera.encoding is None and camera.sensor == "bayer":
        yield ("camera", "pattern"), "belongs to PNG and TIFF; RAW files say it themselves; remove it"
    black, white = camera.black_dn, camera.white_dn
    for key, stated in (("black_dn", black), ("white_dn", white)):
        if stated is not None and camera.encoding == "srgb":
            yield ("camera", key), "belongs to linear values; those of sRGB are decoded to light; remove it"
        elif isinstance(stated, dict) and not coloured:
            yield ("camera", key), f"a {camera.sensor} sensor has one level; give one number"
        elif isinstance(stated, dict):
            for name in stated:
                if name not in BAYER:
                    yield ("camera", key, name), f"a {camera.sensor} sensor has the channels R, G and B"
    for name in BAYER:
        low, high = (level.get(name) if isinstance(level, dict) else level for level in (black, white))
        if low is not None and high is not None and low >= high:
            yield ("camera", "white_dn"), f"must be above black_dn, {low:g}"


def _optics(m: Manifest) -> Iterator[Finding]:
    if m.polarizer:
        yield from _covers(m, ("polarizer", "diattenuation"), m.polarizer.diattenuation)
    if m.retarder:
        stated = m.retarder.retardance_deg
        for name in stated if isinstance(stated, dict) else ():
            yield from _is_channel(m, ("retarder", "retardance_deg", name), name)
    if m.light.uniform and m.light.shape != "surround":
        yield ("light", "uniform"), "belongs to light with shape: surround; a small lamp is never uniform"


def _geometry(m: Manifest) -> Iterator[Finding]:
    kind = m.geometry.kind
    for key, owner in (("s_axis_deg", "stated"), ("charuco", "charuco"), ("sphere", "sphere")):
        given = getattr(m.geometry, key) is not None
        if given and kind != owner:
            yield ("geometry", key), f"belongs to kind: {owner}, and the kind is {kind}; remove it"
        elif kind == owner and not given and owner != "stated":
            yield ("geometry",), f"{key} is missing; kind: {kind} needs it"
    if kind == "sphere":
        lights = [(("light",), m.light), *((("frames", i, "light"), f.light) for i, f in enumerate(m.frames))]
        for place, light in lights:
            # Linear light would have to turn with the plane of incidence around the ball.
            if light and any(light.vector()[1:3]):
                yield place, "light on a ball must be alike from all sides: unpolarized or circular"
    if kind == "charuco":
        sampled = [(i, f) for i, f in enumerate(m.frames) if f.role == "sample"]
        for i, frame in sampled:
            if frame.region is None and m.region is None:
                yield ("frames", i), "region is missing; say where on the board the sample is seen"
    elif kind == "stated":
        for i, frame in enumerate(m.frames):
            if frame.role == "geometry":
                yield ("frames", i, "role"), "geometry belongs to kind: charuco or sphere: detect; remove it"
    stated = [f.s_axis_deg is not None for f in m.frames if f.role == "sample"]
    if kind == "stated" and m.geometry.s_axis_deg is None and not all(stated):
        message = "s_axis_deg is missing; add the angle from the picture's horizontal to s"
        yield ("geometry",), f"{message}: 0 where the plane of incidence stands upright in the picture"


def _frame(m: Manifest, i: int, frame: FrameEntry) -> Iterator[Finding]:
    here = ("frames", i)
    kind = m.geometry.kind
    yield from _region((*here, "region"), frame.region)
    if frame.channel is not None:
        yield from _is_channel(m, (*here, "channel"), frame.channel)
    elif m.camera.sensor in ("mono", "dofp") and len(m.camera.channels) > 1 and frame.role != "dark":
        yield here, "channel is missing; say which one the frame belongs to"
    if m.camera.encoding is None and PurePath(frame.file).suffix.lower() in NOT_RAW:
        message = "8-bit and gamma-encoded images are refused unless camera.encoding says how to undo that"
        yield (*here, "file"), f"'{frame.file}' is not RAW; {message}; give the camera's RAW file"
    dofp = m.camera.sensor in ("dofp", "dofp_bayer")
    if dofp and frame.analyzer_deg is not None:
        message = (
            "is of a polarizer before the lens, and this sensor has its own; take it off and remove the key"
        )
        yield (*here, "analyzer_deg"), message
    yield from _auxiliary(m, here, frame)
    if frame.role != "sample":
        return
    if kind != "stated":
        source = "the ball" if kind == "sphere" else "the board"
        for key in ("theta_deg", "theta_deg_sigma", "s_axis_deg"):
            if getattr(frame, key) is not None:
                yield (*here, key), f"belongs to geometry kind: stated; here {source} says it; remove it"
    elif frame.theta_deg is None:
        yield here, "theta_deg is missing; add the angle of incidence in degrees"
    if frame.analyzer_deg is None and not dofp:
        yield here, "analyzer_deg is missing; add the direction of the polarizer in degrees"
    if frame.retarder_deg is not None and kind != "stated":
        yield (
            (*here, "retarder_deg"),
            "belongs to geometry kind: stated: s must have one direction; remove it",
        )
    elif frame.retarder_deg is not None:
        stated = m.retarder.retardance_deg if m.retarder else {}
        channels = m.camera.channels if frame.channel is None else (frame.channel,)
        if isinstance(stated, dict) and (absent := [c for c in channels if c not in stated]):
            yield (
                (*here, "retarder_deg"),
                f"needs the retarder's retardance_deg for {', '.join(absent)}; add it",
            )


def _auxiliary(m: Manifest, here: Place, frame: FrameEntry) -> Iterator[Finding]:
    """Frames of references and polarizers."""
    if frame.role == "reference":
        if m.geometry.kind != "stated":
            yield (*here, "role"), "reference belongs to geometry kind: stated; remove the frame"
        elif frame.theta_deg is None:
            yield here, "theta_deg is missing; add the angle of incidence in degrees"
        if frame.material is None:
            yield here, f"material is missing; add a built-in material or {WHITE}"
        elif frame.material != WHITE:
            try:
                constants = library.get(frame.material)
                for name in m.camera.channels if frame.channel is None else (frame.channel,):
                    if name in m.camera.channels:
                        constants.absolute_index(m.camera.channels[name].wavelength_nm)
            except ReflectanceFitError as error:
                yield (*here, "material"), str(error)
    elif frame.material is not None:
        yield (*here, "material"), "belongs to role: reference; remove it"
    dofp = m.camera.sensor in ("dofp", "dofp_bayer")
    if frame.role in ("reference", "polarizer") and frame.analyzer_deg is None and not dofp:
        yield here, "analyzer_deg is missing; add the direction of the polarizer in degrees"
    if frame.role == "polarizer" and frame.light and not any(frame.light.vector()[1:3]):
        message = (
            "of a polarizer frame must be linearly polarized, or say nothing of a linear source; correct it"
        )
        yield (*here, "light"), message


def _directions(layout_deg: Iterable[Iterable[float]]) -> set[float]:
    """Axes of one turn, without those that are alike."""
    return {round(axis % 180.0, 6) % 180.0 for row in layout_deg for axis in row}


def _region(place: Place, region: tuple[int, ...] | None) -> Iterator[Finding]:
    if region is not None and not (region[0] < region[2] and region[1] < region[3]):
        yield place, "must be [x0, y0, x1, y1] with x0 below x1 and y0 below y1"


def _covers(m: Manifest, place: Place, stated: float | dict[str, float]) -> Iterator[Finding]:
    """A number for each channel must name all of them and no other."""
    if not isinstance(stated, dict):
        return
    for name in stated:
        yield from _is_channel(m, (*place, name), name)
    if absent := [name for name in m.camera.channels if name not in stated]:
        yield place, f"says nothing of {', '.join(absent)}; add it, or give one number for all"


def _is_channel(m: Manifest, place: Place, name: str) -> Iterator[Finding]:
    known: Iterable[str] = m.camera.channels
    if name not in known:
        near = suggestion(name, known) or f"; there are {', '.join(known)}"
        yield place, f"'{name}' is not among camera.channels{near}"
