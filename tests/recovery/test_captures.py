"""Photographs of known materials, by our synthesis and by another program's: truth within the stated error."""

from __future__ import annotations

import cmath
import math
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reflectance_fit import fit
from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.read import read_capture
from reflectance_fit.capture.truth import read_truth
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.spec import standard_spec
from reflectance_fit.inference import posterior


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(posterior, "MIN_ESS", 1000.0)
    monkeypatch.setattr(posterior, "STEPS_PER_TAU", 20)


def fitted(manifest, model, channel="G"):
    """Report of one channel."""
    measurement = ingest(read_capture(manifest)).measurement
    rows = measurement.observations
    assert (rows.flag == "used").all()
    measurement = replace(measurement, observations=rows.select(rows.channel == channel))
    report = fit(measurement, model=model, timings=False).report
    assert report.fits[0].fit.p_value > 1e-4
    return report


def near(estimate, truth, sd):
    """Identified, within 4 sd, and the sd not larger than ``sd``."""
    assert estimate.status == "identified"
    assert abs(estimate.median - truth) < 4 * estimate.sd
    assert 0 < estimate.sd < sd


# --- our own


@pytest.mark.parametrize(
    ("material", "shape", "model", "sd"),
    [
        ("N-BK7", "flat", "dielectric", (1e-3, 0)),
        ("Au", "flat", "conductor", (1e-3, 1e-3)),
        ("N-BK7", "sphere", "dielectric", (1e-3, 0)),
        ("Au", "sphere", "conductor", (2e-3, 3e-3)),
    ],
)
def test_our_own(tmp_path, material, shape, model, sd):
    spec = standard_spec(material, shape=shape, seed=5)
    spec = replace(spec, sensor=replace(spec.sensor, width=200, height=160))
    report = fitted(write_capture(tmp_path, spec), model)
    truth = read_truth(tmp_path / "truth.yaml")
    (channel,), true = report.channels, truth.channels[1]
    near(channel.eta, true.eta, sd[0])
    near(channel.brewster_deg, true.brewster_deg, 0.1)
    if model == "conductor":
        near(channel.k, true.k, sd[1])
    found = report.fits[0].fit.nuisances
    if shape == "flat":
        for name, width in (("angle_offset_deg", 0.01), ("analyzer_offset_deg", 0.01)):
            injected = truth.nuisances[name]
            assert abs(injected) > 4 * width  # else a fit that returns 0 would do
            assert abs(found[name].median - injected) < 4 * found[name].sd
            assert found[name].sd < width


@pytest.mark.parametrize("level", ["low", "high"])
def test_a_ball_in_other_noise(tmp_path, level):
    """Few electrons with unequal pixels, and flats whose noise is all there is."""
    spec = standard_spec("N-BK7", shape="sphere", noise=level, seed=6)
    spec = replace(spec, sensor=replace(spec.sensor, width=200, height=160))
    report = fitted(write_capture(tmp_path, spec), "dielectric")
    near(report.channels[0].eta, read_truth(tmp_path / "truth.yaml").channels[1].eta, 3e-3)
    assert 0.7 < report.fits[0].fit.reduced_chi2 < 1.35


# --- another program's: fields instead of Stokes vectors, its own files, nothing of ours

AIR = 1.000277
S_AXIS_DEG = 30.0
BLACK = ((200, 210), (190, 205))  # of G R / B G
WHITE, ELECTRONS_PER_DN, READ_E = 16000, 2.0, 4.0
ROWS, COLUMNS = 90, 120
MATERIALS = {
    "glass": {"R": (1.61, 0.0), "G": (1.62, 0.0), "B": (1.64, 0.0)},
    "metal": {"R": (0.21, 3.3), "G": (0.43, 2.4), "B": (1.4, 1.9)},
}
PLATE_DEG = {"R": 80.0, "G": 90.0, "B": 110.0}


def reflected(index, theta_deg, field):
    """Fields (s, p) after reflection; Verdet's signs and exp(-i omega t)."""
    n = complex(*index) / AIR
    c = math.cos(math.radians(theta_deg))
    root = cmath.sqrt(n * n - 1 + c * c)  # n cos(theta_t)
    return (c - root) / (c + root) * field[0], (n * n * c - root) / (n * n * c + root) * field[1]


def turned(field, degrees):
    """Components along axes that are turned by ``degrees`` from the first towards the second."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return c * field[0] + s * field[1], -s * field[0] + c * field[1]


def passed(index, theta_deg, light, analyzer_deg, plate_deg=None, plate=90.0):
    """Power behind the analyzer: the mean of the incoherent fields in ``light``."""
    power = 0.0
    for field in light:
        here = turned(reflected(index, theta_deg, field), -S_AXIS_DEG)  # the picture's axes
        if plate_deg is not None:
            fast, slow = turned(here, plate_deg)
            here = turned((fast, slow * cmath.exp(1j * math.radians(plate))), -plate_deg)
        power += abs(turned(here, analyzer_deg)[0]) ** 2
    return power / len(light)


def tag(number, kind, *values):
    """A TIFF entry, its values apart."""
    form = {1: "B", 2: "s", 3: "H", 4: "I", 5: "I", 12: "d"}[kind]
    data = values[0] if kind == 2 else struct.pack(f">{len(values)}{form}", *values)
    return number, kind, len(data) if kind == 2 else len(values) // (2 if kind == 5 else 1), data


def dng(path, cfa):
    """A big-endian DNG of 16 bits, the exposure of 1/50 s and the ISO in its only directory."""
    height, width = cfa.shape
    pixels = cfa.astype(">u2").tobytes()
    tags = [
        tag(254, 4, 0), tag(256, 4, width), tag(257, 4, height), tag(258, 3, 16), tag(259, 3, 1),
        tag(262, 3, 32803), tag(271, 2, b"Other\0"), tag(272, 2, b"Other\0"), tag(273, 4, 0), tag(277, 3, 1),
        tag(278, 4, height), tag(279, 4, len(pixels)), tag(33421, 3, 2, 2), tag(33422, 1, 1, 0, 2, 1),
        tag(33434, 5, 1, 50), tag(34855, 3, 400), tag(50706, 1, 1, 4, 0, 0), tag(50708, 2, b"Other one\0"),
        tag(50713, 3, 2, 2), tag(50714, 4, *BLACK[0], *BLACK[1]), tag(50717, 4, WHITE),
    ]  # fmt: skip
    start = 8 + 2 + 12 * len(tags) + 4
    room = b""
    entries = b""
    for number, kind, count, data in tags:
        if number == 273:
            entries += struct.pack(">HHI", number, kind, count) + b"PIXS"
            continue
        if len(data) > 4:
            place = struct.pack(">I", start + len(room))
            room += data + bytes(len(data) % 2)
        else:
            place = data.ljust(4, b"\0")
        entries += struct.pack(">HHI", number, kind, count) + place
    entries = entries.replace(b"PIXS", struct.pack(">I", start + len(room)))
    head = b"MM\0*" + struct.pack(">IH", 8, len(tags))
    path.write_bytes(head + entries + bytes(4) + room + pixels)


def photograph(folder: Path, material: str) -> Path:
    """capture.yaml and frames: GRBG, one gain an angle, 45 degree light, plate and analyzer."""
    generator = np.random.default_rng(17)
    (folder / "shots").mkdir()
    x = np.arange(COLUMNS)
    response = 1 + 0.01 * generator.standard_normal((ROWS, COLUMNS)) - 1e-3 * x
    light = [(math.sqrt(0.5), math.sqrt(0.5))]
    angles = (40, 52, 58, 66, 74) if material == "glass" else (50, 62, 70, 76, 82)
    lines = []

    def shoot(name, powers):
        cfa = np.empty((ROWS, COLUMNS))
        for i, colour in enumerate("GRBG"):
            y, x = divmod(i, 2)
            mean = powers[colour] * 2.4e4 * response[y::2, x::2] + 20.0  # electrons, of them dark 20
            counts = generator.poisson(mean) + READ_E * generator.standard_normal(mean.shape)
            cfa[y::2, x::2] = counts / ELECTRONS_PER_DN + BLACK[y][x]
        dng(folder / "shots" / name, np.clip(np.rint(cfa), 0, WHITE).astype(np.uint16))

    for theta in angles:
        lamp = generator.uniform(0.5, 1.0)  # turned up and down between angles
        for analyzer, plate in (
            (0, None),
            (40, None),
            (75, None),
            (120, None),
            (150, None),
            (80, 20),
            (170, 20),
        ):
            powers = {
                colour: lamp * passed(index, theta, light, analyzer, plate, PLATE_DEG[colour])
                for colour, index in MATERIALS[material].items()
            }
            name = f"{theta}-{analyzer}{'' if plate is None else '-plate'}.dng"
            shoot(name, powers)
            wave = "" if plate is None else f", retarder_deg: {plate}"
            lines.append(f"  - {{file: shots/{name}, theta_deg: {theta}, analyzer_deg: {analyzer}{wave}}}\n")
    for name in ("cap1.dng", "cap2.dng"):
        shoot(name, dict.fromkeys("RGB", 0.0))
        lines.append(f"  - {{file: shots/{name}, role: dark}}\n")
    text = f"""# by hand
schema: reflectance_fit/capture/1
sample: {{name: {material}}}
camera:
  sensor: bayer
  channels: {{G: {{wavelength_nm: 550}}, R: {{wavelength_nm: 610}}, B: {{wavelength_nm: 460}}}}
  noise: {{gain_e_per_dn: {ELECTRONS_PER_DN}, read_noise_e: {READ_E}}}
retarder: {{retardance_deg: {{R: 80, G: 90, B: 110}}}}
light: {{linear_deg: 45}}
geometry: {{kind: stated, s_axis_deg: 30}}
region: [13, 11, 110, 84]
nuisances: {{}}
frames:
{"".join(lines)}"""
    (folder / "capture.yaml").write_text(text)
    return folder / "capture.yaml"


@pytest.mark.parametrize(
    ("material", "model", "channel"),
    [("glass", "dielectric", "G"), ("metal", "conductor", "R"), ("metal", "conductor", "B")],
)
def test_another_program_s(tmp_path, material, model, channel):
    report = fitted(photograph(tmp_path, material), model, channel)
    eta, k = MATERIALS[material][channel]
    near(report.channels[0].eta, eta, 1e-3)
    if k:
        near(report.channels[0].k, k, 2e-3)
    assert 0.3 < report.fits[0].fit.reduced_chi2 < 2


def test_another_program_s_turned_rig_is_not_ours_unturned(tmp_path):
    """The same photographs with a wrong s_axis_deg fit nothing."""
    manifest = photograph(tmp_path, "metal")
    manifest.write_text(manifest.read_text().replace("s_axis_deg: 30", "s_axis_deg: -30"))
    with pytest.raises(AssertionError):
        fitted(manifest, "conductor", "R")
