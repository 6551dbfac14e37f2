"""Frames that calibrate a capture, from files to rows: pairs of flats, a polarized lamp, a known surface."""

import json
import math
import re
from fractions import Fraction

import numpy as np
import pytest

from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.read import read_capture
from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng
from reflectance_fit.data_synthetic.sensor import Sensor, expose, fixed_pattern
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.materials import library
from reflectance_fit.physics.fresnel import amplitudes
from reflectance_fit.physics.mueller import reflection
from reflectance_fit.physics.stokes import analyzer_signal, linear, unpolarized

SENSOR = Sensor(
    width=320,
    height=240,
    pattern="MONO",
    black=((500, 500), (500, 500)),
    gain_e_per_dn=2.5,
    read_noise_e=4.0,
    prnu=0.01,
    dsnu_dn=1.0,
    background_e_per_s=0.0,
    sensitivity_e_per_s=(3e5, 3e5, 3e5),
)
PIXELS = fixed_pattern(SENSOR, np.random.default_rng(8))
LEAKAGE = 0.99  # diattenuation: an extinction ratio of 199
ZERO_DEG = 1.7  # what the analyzer's mark is off by
AXES = (0.0, 45.0, 90.0, 135.0)
THETAS = (45.0, 60.0, 70.0)
HEAD = {
    "schema": "reflectance_fit/capture/1",
    "sample": {"name": "N-SF11"},
    "camera": {"sensor": "mono", "channels": {"550": {"wavelength_nm": 550}}},
    "geometry": {"kind": "stated", "s_axis_deg": 0},
    "region": [80, 60, 240, 180],
}


def passed(stokes, axis_deg):
    return float(analyzer_signal(stokes, math.radians(axis_deg + ZERO_DEG), LEAKAGE))


def mirrored(material, theta_deg):
    """Stokes vector of unpolarized light off the material in air."""
    eta, k = library.get(material).absolute_index(550)
    cos = math.cos(math.radians(theta_deg))
    return reflection(*amplitudes(cos, eta / 1.000277, k / 1.000277)) @ unpolarized()


class Folder:
    """Photographs that are written as they are named."""

    def __init__(self, path):
        self.path, self.frames = path, []

    def shoot(self, signal, exposure_s=Fraction(1), sensor=SENSOR, seed=None, **entry):
        number = len(self.frames)
        image = np.full((sensor.height, sensor.width), signal, dtype=np.float32)
        generator = np.random.default_rng([17, number if seed is None else seed])
        cfa = expose(image, exposure_s, sensor, PIXELS, generator)
        metadata = DngMetadata("MONO", 14, (500,) * 4, sensor.white, exposure_s, 100, None)
        write_dng(self.path / f"{number:03d}.dng", cfa, metadata)
        self.frames.append({"file": f"{number:03d}.dng", **entry})

    def ingest(self, **keys):
        path = self.path / "capture.yaml"
        path.write_text(json.dumps(HEAD | {"frames": self.frames} | keys))  # which is YAML
        return ingest(read_capture(path))

    def refusal(self, **keys):
        with pytest.raises(ReflectanceFitError) as caught:
            self.ingest(**keys)
        return str(caught.value)


@pytest.fixture
def folder(tmp_path):
    return Folder(tmp_path)


def sample(folder, theta_deg=60.0, axis_deg=0.0, lamp=0.3):
    signal = lamp * passed(mirrored("N-SF11", theta_deg), axis_deg)
    folder.shoot(signal, theta_deg=theta_deg, analyzer_deg=axis_deg)


def codes(found):
    return [note.code for note in found.measurement.warnings if note.code != "NO_HASHES"]


def test_noise_comes_from_pairs_of_flats_and_darks(folder):
    sample(folder)
    for level in (0.01, 0.03, 0.07, 0.1):
        for _ in range(2):
            # Of axes that are not the frame's: they serve none, and yet tell the noise.
            folder.shoot(level, role="flat", analyzer_deg=1000 * level)
    for _ in range(2):
        folder.shoot(0.0, role="dark")
    found = folder.ingest()
    noise = found.capture.transfer["550"]
    assert noise.gain_e_per_dn == pytest.approx(2.5, rel=0.005)
    assert noise.read_noise_e == pytest.approx(4.0, rel=0.02)
    assert noise.prnu == pytest.approx(0.01, rel=0.03)
    assert codes(found) == []
    assert found.unused == frozenset()
    (line,) = found.told
    assert line.startswith(f"550: gain {noise.gain_e_per_dn:.4g} electrons a DN")
    (row,) = found.measurement.observations.value[None]
    dn = row[0]
    pixels = 160 * 120
    darks = 4.0**2 / 2.5**2 + 1 / 12
    expected = math.sqrt((dn / 2.5 + darks + darks / 2) / pixels)
    assert found.measurement.observations.sigma[0] == pytest.approx(expected, rel=0.01)


def test_stated_noise_goes_before_pairs(folder):
    sample(folder)
    for level in (0.02, 0.02, 0.08, 0.08):
        folder.shoot(level, role="flat", analyzer_deg=1000 * level)
    camera = HEAD["camera"] | {"noise": {"gain_e_per_dn": 1.0, "read_noise_e": 0.0}}
    found = folder.ingest(camera=camera)
    assert found.capture.transfer == {}
    value, sigma = found.measurement.observations.value[0], found.measurement.observations.sigma[0]
    assert sigma == pytest.approx(math.sqrt((value + 1 / 12) / (160 * 120)))


def test_a_single_flat_says_that_its_sigma_is_a_guess(folder):
    sample(folder)
    folder.shoot(0.1, role="flat")
    found = folder.ingest()
    assert codes(found) == ["SIGMA_ESTIMATED"]
    assert "in pairs" in found.measurement.warnings[0].message


def lamp(folder, axes=range(0, 180, 15), source_deg=20.0, **entry):
    for axis in axes:
        folder.shoot(
            0.1 * passed(linear(math.radians(source_deg)), axis), role="polarizer", analyzer_deg=axis, **entry
        )


def noise_of(folder):
    for _ in range(2):
        folder.shoot(0.0, role="dark")


STATED_NOISE = HEAD["camera"] | {"noise": {"gain_e_per_dn": 2.5, "read_noise_e": 4.0}}


def test_a_malus_series_gives_leakage_and_zero(folder):
    for axis in AXES:
        sample(folder, axis_deg=axis)
    lamp(folder, light={"linear_deg": 20.0})
    noise_of(folder)
    found = folder.ingest(camera=STATED_NOISE, nuisances={"analyzer_offset_deg": {}})
    assert found.capture.diattenuation["550"] == pytest.approx(LEAKAGE, abs=3e-4)
    rows = found.measurement.observations
    np.testing.assert_allclose(rows.diattenuation, LEAKAGE, atol=3e-4)
    np.testing.assert_allclose(rows.analyzer_deg, np.add(AXES, ZERO_DEG), atol=0.02)
    # What is left of the zero's error and of the leakage's is what the series says, not a default.
    assert found.measurement.nuisances == {}
    known = found.measurement.known("550")
    assert set(known) == {"analyzer_offset_deg", "diattenuation"}
    assert 0 < known["analyzer_offset_deg"] < 0.02
    assert abs(found.capture.diattenuation["550"] - LEAKAGE) / LEAKAGE < 4 * known["diattenuation"] < 3e-4
    assert [line.split()[0] for line in found.told] == ["extinction", "analyzer"]
    assert codes(found) == []


def test_measured_errors_are_allowed_for_unless_the_manifest_says_otherwise(folder):
    sample(folder)
    lamp(folder, light={"linear_deg": 20.0})

    def known(**changes):
        measurement = folder.ingest(camera=STATED_NOISE, **changes).measurement
        return measurement.nuisances, set(measurement.common_sigmas)

    both = {"analyzer_offset_deg", "diattenuation"}
    assert known() == (None, both)
    assert known(nuisances={"diffuse": {"sigma": 0.01}}) == ({"diffuse": 0.01}, both)
    stated = {"analyzer_offset_deg": 0.7}
    assert known(nuisances={"analyzer_offset_deg": {"sigma": 0.7}}) == (stated, {"diattenuation"})
    assert known(nuisances={}) == ({}, set())
    assert known(polarizer={"diattenuation": 0.95}) == (None, {"analyzer_offset_deg"})


def test_without_the_sources_direction_the_axes_stay(folder):
    sample(folder)
    lamp(folder)
    found = folder.ingest(camera=STATED_NOISE)
    assert found.capture.diattenuation["550"] == pytest.approx(LEAKAGE, abs=5e-4)
    assert found.measurement.observations.analyzer_deg[0] == 0.0


def test_a_stated_diattenuation_stays(folder):
    sample(folder)
    lamp(folder, light={"linear_deg": 20.0})
    found = folder.ingest(camera=STATED_NOISE, polarizer={"diattenuation": 0.95})
    assert found.capture.diattenuation == {"550": 0.95}
    assert found.measurement.observations.analyzer_deg[0] == pytest.approx(ZERO_DEG, abs=0.02)


def test_a_crossed_pair_gives_leakage(folder):
    sample(folder)
    lamp(folder, axes=(20.0 - ZERO_DEG, 110.0 - ZERO_DEG))
    found = folder.ingest(camera=STATED_NOISE)
    assert found.capture.diattenuation["550"] == pytest.approx(LEAKAGE, abs=5e-4)


def test_a_series_that_tells_nothing_is_an_error(folder):
    sample(folder)
    lamp(folder, axes=(0.0, 45.0))
    assert "three analyzer angles, or two that are crossed" in folder.refusal(camera=STATED_NOISE)


def test_a_source_without_polarization_is_refused(folder):
    sample(folder)
    lamp(folder, light={"circular": "right"})
    assert "must be linearly polarized" in folder.refusal(camera=STATED_NOISE)


def with_references(folder, material="N-BK7", drift=lambda theta, axis: 1.0, skip=None):
    """The lamp is another at every angle; ``drift`` is common to a sample frame and its reference."""
    for theta in THETAS:
        for axis in AXES:
            strength = 0.3 * drift(theta, axis)
            sample(folder, theta, axis, strength)
            if (theta, axis) != skip:
                beam = unpolarized() * 0.2 if material == "white" else mirrored(material, theta)
                folder.shoot(
                    strength * passed(beam, axis),
                    theta_deg=theta,
                    analyzer_deg=axis,
                    role="reference",
                    material=material,
                )


def wild(theta, axis):
    return 0.4 + 0.3 * math.sin(theta) + 0.2 * math.cos(3 * axis)


OPTICS = {"diattenuation": LEAKAGE}


def turned(frames):
    """Angles as they truly are, so that only the references are on trial."""
    return [f | {"analyzer_deg": f["analyzer_deg"] + ZERO_DEG} if "analyzer_deg" in f else f for f in frames]


def test_a_known_surface_takes_the_lamp_out_of_all_angles(folder):
    with_references(folder, drift=wild)
    found = folder.ingest(camera=STATED_NOISE, polarizer=OPTICS, frames=turned(folder.frames))
    rows = found.measurement.observations
    used = rows.flag == "used"
    assert np.count_nonzero(used) >= 11
    assert set(rows.gain_group) == {"0"}
    expected = [passed(mirrored("N-SF11", theta), axis) for theta in THETAS for axis in AXES]
    pulls = ((rows.value - expected) / rows.sigma)[used]
    # The gain is 1: what is left is noise and what PRNU leaves in neither.
    assert np.abs(pulls).max() < 4
    assert 0.5 < np.std(pulls) < 1.6
    assert codes(found) == []


def test_a_reference_that_hardly_reflects_gives_no_ratio(folder):
    """Near Brewster's angle of the reference, crossed, what comes is leakage a few counts strong."""
    sample(folder, 56.65, 90.0)
    sample(folder, 56.65, 0.0)
    for axis in (90.0, 0.0):
        folder.shoot(
            1e-7 if axis else 0.1, theta_deg=56.65, analyzer_deg=axis, role="reference", material="N-BK7"
        )
    found = folder.ingest(camera=STATED_NOISE)
    assert found.measurement.observations.flag.tolist() == ["rejected", "used"]


def test_white_takes_drift_out_within_an_angle_and_leaves_its_gain(folder):
    with_references(folder, "white", drift=wild)
    found = folder.ingest(camera=STATED_NOISE, polarizer=OPTICS, frames=turned(folder.frames))
    rows = found.measurement.observations
    assert len(set(rows.gain_group)) == len(THETAS)
    expected = np.array([passed(mirrored("N-SF11", theta), axis) for theta in THETAS for axis in AXES])
    for theta in THETAS:
        mine = rows.theta_deg == theta
        ratio = rows.value[mine] / expected[mine]
        assert np.ptp(ratio) / ratio.mean() < 5 * np.max(rows.sigma[mine] / rows.value[mine])


def test_without_references_the_same_drift_is_noticed(folder):
    for axis in AXES:
        sample(folder, 60.0, axis, 0.3 * wild(60.0, axis))
    found = folder.ingest(camera=STATED_NOISE)
    assert codes(found) == ["IMBALANCE"]
    truth = [wild(60.0, a) * passed(mirrored("N-SF11", 60.0), a) for a in AXES]
    worst = 100 * ((truth[0] + truth[2]) / (truth[1] + truth[3]) - 1)
    told = re.search(r"worst ([+-][0-9.]+) %", found.measurement.warnings[0].message)
    assert float(told[1]) == pytest.approx(worst, abs=0.2)


def test_a_frame_without_its_reference_is_an_error(folder):
    with_references(folder, skip=(60.0, 45.0))
    assert "has no reference of equal theta_deg" in folder.refusal(camera=STATED_NOISE)


def test_a_lost_reference_costs_its_frame_alone(folder):
    with_references(folder)
    metadata = DngMetadata("MONO", 14, (500,) * 4, SENSOR.white, Fraction(1), 100, None)
    write_dng(folder.path / folder.frames[1]["file"], np.full((240, 320), 500, np.uint16), metadata)
    found = folder.ingest(camera=STATED_NOISE)
    assert found.rejected[folder.frames[0]["file"]] == "has lost its reference"
    assert len(found.samples) == 11


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"role": "reference", "theta_deg": 60, "analyzer_deg": 0}, "material is missing"),
        (
            {"role": "reference", "theta_deg": 60, "analyzer_deg": 0, "material": "bk8"},
            "no built-in material 'bk8'",
        ),
        ({"role": "reference", "analyzer_deg": 0, "material": "white"}, "theta_deg is missing"),
        ({"role": "reference", "theta_deg": 60, "material": "white"}, "analyzer_deg is missing"),
        ({"role": "flat", "material": "white"}, "belongs to role: reference"),
        ({"role": "polarizer"}, "analyzer_deg is missing"),
    ],
)
def test_what_such_frames_must_say(folder, entry, message):
    sample(folder)
    folder.shoot(0.1, **entry)
    assert message in folder.refusal(camera=STATED_NOISE)


def test_sigma_of_a_ratio_holds_the_noise_of_both(folder):
    sample(folder)
    folder.shoot(0.02, theta_deg=60, analyzer_deg=0, role="reference", material="white")
    ratio = folder.ingest(camera=STATED_NOISE).measurement.observations
    alone = [{key: f[key] for key in ("file", "theta_deg", "analyzer_deg")} for f in folder.frames]
    alone[1]["set"] = "other"
    apart = folder.ingest(camera=STATED_NOISE, frames=alone).measurement.observations
    expected = math.hypot(*(apart.sigma / apart.value))
    assert ratio.sigma[0] / ratio.value[0] == pytest.approx(expected)
