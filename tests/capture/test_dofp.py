"""Sensors with polarizers on their pixels: labels, rows, and what files of them may look like."""

import json
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import yaml

from reflectance_fit.capture.bins import Region
from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.pixel_maps import PixelMaps
from reflectance_fit.capture.raw import Plane, RawFrame
from reflectance_fit.capture.read import read_capture
from reflectance_fit.capture.reading import Reading, _as_stated, _without_unused_bits
from reflectance_fit.capture.reduce import reduce_frame
from reflectance_fit.data_synthetic.capture import write_capture
from reflectance_fit.data_synthetic.dng import DngMetadata, write_dng
from reflectance_fit.data_synthetic.spec import standard_spec
from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.physics.fresnel import amplitudes
from reflectance_fit.physics.mueller import reflection
from reflectance_fit.physics.stokes import analyzer_signal, linear, unpolarized

LAYOUT = ((90.0, 45.0), (135.0, 0.0))


def frame_of(cfa, black=100.0, white=4000.0):
    """A frame of a sensor without colour filters."""
    return RawFrame(
        cfa,
        np.full((2, 2), "mono"),
        np.full((2, 2), np.nan),
        np.full((2, 2), black),
        np.full((2, 2), white),
        None,
        None,
        None,
    )


def labelled(cfa, sensor="dofp", colours="RGGB"):
    return _as_stated(frame_of(cfa), Reading(sensor, LAYOUT, pattern=colours))


def pixels(shape=(24, 32), seed=0):
    return np.random.default_rng(seed).integers(200, 3000, shape).astype(np.uint16)


@pytest.mark.parametrize("region", [(0, 0, 32, 24), (3, 5, 22, 18), (7, 1, 8, 2)])
def test_each_pixel_counts_once_in_its_axis_whatever_the_region_begins_with(region):
    """An odd region does not move the layout: labels belong to the file's pixels."""
    cfa = pixels()
    x0, y0, x1, y1 = region
    means = reduce_frame(labelled(cfa), (Region(*region),)).over(Region(*region))
    assert set(means) == {Plane("mono", axis) for axis in (0.0, 45.0, 90.0, 135.0)}
    for plane, found in means.items():
        seen = [
            float(cfa[y, x]) - 100
            for y in range(y0, y1)
            for x in range(x0, x1)
            if LAYOUT[y % 2][x % 2] == plane.axis_deg
        ]
        assert found.pixels == [len(seen)]
        if seen:
            assert found.mean == pytest.approx([np.mean(seen)])


@pytest.mark.parametrize("colours", ["RGGB", "GBRG"])
def test_colour_cells_are_groups_of_one_colour_with_all_axes(colours):
    cfa = pixels()
    means = reduce_frame(labelled(cfa, "dofp_bayer", colours), (Region(),)).over(Region())
    assert len(means) == 12
    for plane, found in means.items():
        seen = [
            float(cfa[y, x]) - 100
            for y in range(24)
            for x in range(32)
            if LAYOUT[y % 2][x % 2] == plane.axis_deg
            and colours[2 * (y // 2 % 2) + x // 2 % 2] == plane.channel
        ]
        assert found.pixels == [len(seen)]
        assert found.mean == pytest.approx([np.mean(seen)])


@pytest.mark.parametrize(("bits", "shift"), [(12, 4), (10, 6), (14, 2)])
def test_left_justified_counts_are_put_right(bits, shift):
    cfa = np.random.default_rng(1).integers(0, 2**bits, (64, 64)).astype(np.uint16)
    left = replace(labelled(cfa << shift), black=np.full((2, 2), 64.0), white=np.full((2, 2), 65535.0))
    found = _without_unused_bits(left)
    assert found.unused_bits == shift
    np.testing.assert_array_equal(found.cfa, cfa)
    assert found.cfa.dtype == np.uint16
    assert found.black[0, 0] == 64 / 2**shift
    assert found.white[0, 0] == 65535 / 2**shift
    assert reduce_frame(found, (Region(),)).unused_bits == shift


@pytest.mark.parametrize(
    "cfa",
    [
        pixels(),
        np.array([[1024, 4096], [2048, 8192]], np.uint16).repeat(8, axis=0).repeat(8, axis=1),
        2 * pixels(),
        np.zeros((8, 8), np.uint16),
    ],
    ids=["full depth", "few values", "digital gain of 2", "nothing"],
)
def test_other_counts_are_left_alone(cfa):
    found = _without_unused_bits(labelled(cfa))
    assert found.unused_bits == 0
    assert found.cfa is not None
    np.testing.assert_array_equal(found.cfa, cfa)


def test_colour_photographs_are_never_taken_for_left_justified():
    bayer = replace(frame_of(pixels() << 4), channels=np.array([["R", "G"], ["G", "B"]]))
    assert _without_unused_bits(bayer) is bayer


def test_maps_act_on_pixels_before_they_are_averaged():
    """An unlike pixel is put right by its own offset and gain, which no correction of the mean could do."""
    generator = np.random.default_rng(2)
    offset = generator.uniform(80, 120, (24, 32)).astype(np.float32)
    gain = generator.uniform(0.8, 1.2, (24, 32)).astype(np.float32)
    gain /= np.median(gain)
    light = pixels(seed=5).astype(float)
    cfa = np.rint(light / gain + offset).astype(np.uint16)
    frame = replace(labelled(cfa), maps=PixelMaps(offset, gain))
    for region in (Region(), Region(3, 5, 21, 20)):
        for plane, found in reduce_frame(frame, (region,)).over(region).items():
            rows, columns = np.indices(cfa.shape)
            mine = np.array(LAYOUT)[rows % 2, columns % 2] == plane.axis_deg
            box = np.zeros_like(mine)
            box[region.box()] = True
            # Rounding of up to half a count a pixel.
            assert found.mean == pytest.approx([light[mine & box].mean()], abs=0.12)


def model(spec, theta_deg, axis_deg, channel, light=None):
    """Power behind the analyzer for a beam of 1, by Fresnel's equations."""
    eta, k = spec.index_of(channel)
    mirror = reflection(*amplitudes(math.cos(math.radians(theta_deg)), eta / 1.000277, k / 1.000277))
    return analyzer_signal(
        mirror @ (unpolarized() if light is None else light), np.radians(axis_deg), spec.faults.diattenuation
    )


@pytest.fixture(scope="module", params=["dofp", "dofp_bayer"])
def written(request, tmp_path_factory):
    spec = standard_spec("N-BK7", sensor=request.param, noise="typical", angles_deg=(45.0, 60.0))
    spec = replace(
        spec,
        sensor=replace(spec.sensor, width=256, height=192),
        faults=replace(spec.faults, angle_offset_deg=0.0),
    )
    folder = tmp_path_factory.mktemp(request.param)
    write_capture(folder, spec)
    return folder / "capture.yaml", spec


def test_every_frame_gives_a_row_for_each_axis(written):
    path, spec = written
    found = ingest(read_capture(path))
    rows = found.measurement.observations
    channels = len(spec.channels)
    assert len(rows) == channels * 2 * 4
    assert [note.code for note in found.measurement.warnings] == []
    for channel in spec.channels:
        for theta in (45.0, 60.0):
            mine = rows.select((rows.channel == channel.name) & (rows.theta_deg == theta))
            assert sorted(mine.analyzer_deg % 180) == [0.0, 45.0, 90.0, 135.0]
            assert len(set(mine.gain_group)) == 1
            expected = model(spec, theta, mine.analyzer_deg + spec.faults.analyzer_offset_deg, channel)
            weight = expected / mine.sigma**2
            gain = np.sum(weight * mine.value) / np.sum(weight * expected)
            pulls = (mine.value - gain * expected) / mine.sigma
            assert np.sum(pulls**2) < 25, pulls


def harmed(written, tmp_path, edit):
    """The capture with its capture.yaml edited."""
    path, _ = written
    data = yaml.safe_load(path.read_text())
    for frame in data["frames"]:
        frame.pop("sha256", None)
    edit(data)
    new = path.with_name("edited.yaml")
    new.write_text(yaml.safe_dump(data))
    return new


def refusal(path):
    with pytest.raises(ReflectanceFitError) as caught:
        ingest(read_capture(path))
    return str(caught.value)


def test_a_polarizer_before_such_a_sensor_is_refused(written, tmp_path):
    path = harmed(written, tmp_path, lambda data: data["frames"][0].update(analyzer_deg=0))
    assert "this sensor has its own; take it off" in refusal(path)


def test_a_layout_of_one_direction_is_refused(written, tmp_path):
    path = harmed(
        written, tmp_path, lambda data: data["camera"].update(dofp_layout_deg=[[0, 180], [90, -90]])
    )
    assert "three different axes" in refusal(path)


def test_the_sense_of_the_axes_reverses_with_the_layout(tmp_path):
    """At 45 degrees linear light, s turned: the diagonal rows swap, and so does the angle of polarization."""
    cfa = np.empty((32, 32), np.uint16)
    for (y, x), axis in np.ndenumerate(np.array(LAYOUT)):
        cfa[y::2, x::2] = 100 + np.rint(
            1000 * analyzer_signal(linear(math.radians(20.0)), math.radians(axis))
        )
    for layout, expected in ((LAYOUT, 20.0), (((90.0, 135.0), (45.0, 0.0)), -20.0)):
        frame = _as_stated(frame_of(cfa), Reading("dofp", layout))
        means = {p.axis_deg: m.mean[0] for p, m in reduce_frame(frame, (Region(),)).over(Region()).items()}
        found = 0.5 * math.atan2(means[45.0] - means[135.0], means[0.0] - means[90.0])
        assert math.degrees(found) == pytest.approx(expected, abs=0.1)


def lamp(folder, sources_deg, layout=LAYOUT, stated=True, response=(1.0, 1.0, 1.0, 1.0), true=LAYOUT):
    """A capture of a dofp sensor with a polarized lamp; returns its path."""
    frames = []
    for number, source_deg in enumerate([None, *sources_deg]):
        beam = unpolarized() if source_deg is None else linear(math.radians(source_deg))
        mean = np.empty((64, 64))
        for (y, x), axis in np.ndenumerate(np.array(true)):
            mean[y::2, x::2] = response[2 * y + x] * 8000 * analyzer_signal(beam, math.radians(axis), 0.98)
        cfa = np.rint(np.random.default_rng(number).normal(100 + mean, np.sqrt(mean + 4))).astype(np.uint16)
        write_dng(
            folder / f"{number}.dng", cfa, DngMetadata("MONO", 14, (100,) * 4, 16000, Fraction(1, 10), 100)
        )
        entry = {"file": f"{number}.dng", "theta_deg": 45}
        if source_deg is not None:
            entry = {"file": f"{number}.dng", "role": "polarizer"}
            if stated:
                entry["light"] = {"linear_deg": source_deg}
        frames.append(entry)
    camera = {
        "sensor": "dofp",
        "dofp_layout_deg": [list(row) for row in layout],
        "channels": {"550": {"wavelength_nm": 550}},
        "noise": {"gain_e_per_dn": 1, "read_noise_e": 2},
    }
    path = folder / "capture.yaml"
    head = {"schema": "reflectance_fit/capture/1", "sample": {"name": "x"}, "camera": camera}
    path.write_text(json.dumps(head | {"geometry": {"kind": "stated", "s_axis_deg": 0}, "frames": frames}))
    return path


@pytest.mark.parametrize("stated", [True, False])
def test_one_photograph_of_a_polarized_lamp_tells_the_leakage(tmp_path, stated):
    found = ingest(read_capture(lamp(tmp_path, [20.0], stated=stated)))
    assert found.capture.diattenuation["550"] == pytest.approx(0.98, abs=1e-3)
    assert found.measurement.observations.diattenuation[0] == pytest.approx(0.98, abs=1e-3)


def test_a_sensor_mounted_askew_is_put_right(tmp_path):
    askew = tuple(tuple(axis + 1.5 for axis in row) for row in LAYOUT)
    found = ingest(read_capture(lamp(tmp_path, [20.0], true=askew)))
    np.testing.assert_allclose(
        sorted(found.measurement.observations.analyzer_deg), [1.5, 46.5, 91.5, 136.5], atol=0.1
    )


def test_a_turning_source_does_not_mind_pixels_that_respond_unlike(tmp_path):
    response = (1.0, 1.1, 0.95, 1.0)
    turning = ingest(read_capture(lamp(tmp_path, range(0, 180, 30), response=response)))
    assert turning.capture.diattenuation["550"] == pytest.approx(0.98, abs=1e-3)
    (tmp_path / "one").mkdir()
    one = ingest(read_capture(lamp(tmp_path / "one", [20.0], response=response)))
    assert abs(one.capture.diattenuation["550"] - 0.98) > 5e-3
    assert "IMBALANCE" in [note.code for note in turning.measurement.warnings]


@pytest.mark.parametrize("layout", [((90.0, 135.0), (45.0, 0.0)), ((45.0, 90.0), (135.0, 0.0))])
def test_a_wrong_layout_stops_the_reading(tmp_path, layout):
    path = lamp(tmp_path, range(0, 180, 30), layout=layout)
    assert "is dofp_layout_deg mirrored, or turned the other way?" in refusal(path)


def test_a_ball_is_seen_through_each_pixels_own_axis(tmp_path):
    """All rings and sectors follow Fresnel's equations to within their sigma, one gain a ring, from one photograph."""
    spec = standard_spec("N-BK7", sensor="dofp", shape="sphere")
    spec = replace(spec, sensor=replace(spec.sensor, width=480, height=384))
    write_capture(tmp_path, spec)
    found = ingest(read_capture(tmp_path / "capture.yaml"))
    assert [note.code for note in found.measurement.warnings] == []
    rows = found.measurement.observations.used
    (channel,) = spec.channels
    chi2, dof = 0.0, 0
    for group in set(rows.gain_group):
        mine = rows.select(rows.gain_group == group)
        expected = []
        for i in range(len(mine)):
            ends = mine.theta_deg[i] + np.array([-1, 1]) * mine.theta_deg_spread[i]
            along = np.mean([model(spec, end, mine.analyzer_deg[i], channel) for end in ends])
            across = np.mean([model(spec, end, mine.analyzer_deg[i] + 90, channel) for end in ends])
            share = mine.diattenuation[i] / spec.faults.diattenuation
            expected.append((along + across + share * (along - across)) / 2)
        expected = np.array(expected)
        weight = expected / mine.sigma**2
        gain = np.sum(weight * mine.value) / np.sum(weight * expected)
        chi2 += np.sum(((mine.value - gain * expected) / mine.sigma) ** 2)
        dof += len(mine) - 1
    assert dof > 150
    assert chi2 / dof == pytest.approx(1.0, abs=4 * math.sqrt(2 / dof))
