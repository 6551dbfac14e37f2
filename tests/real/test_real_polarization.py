"""Polarization cameras that others photographed with: what their files say once the axes are named.

Files and what is known of them: MANIFEST.csv of the data.
"""

import json
import math
import re
import shutil

import cv2
import numpy as np
import pytest

from reflectance_fit.capture.bins import Region
from reflectance_fit.capture.ingest import ingest
from reflectance_fit.capture.pixel_maps import checked_maps, read_map
from reflectance_fit.capture.raw import Plane
from reflectance_fit.capture.read import read_capture
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.capture.reduce import reduce_frame
from reflectance_fit.capture.stokes_pixels import fit_stokes, redundancy
from reflectance_fit.errors import ReflectanceFitError

LAYOUT = ((90.0, 45.0), (135.0, 0.0))
MIRRORED = ((90.0, 135.0), (45.0, 0.0))
# Inside the four discs of polarizing film, whose labels read 0, 45, 90 and 135.
DISCS = ((280, 990, 480, 1190), (900, 1000, 1100, 1200), (1450, 1000, 1650, 1200), (2010, 1010, 2210, 1210))
AOLP_DEG = (83.4, 43.7, -4.9, -44.6)


@pytest.fixture(scope="module")
def mosaic(data):
    return data / "polarization/polanalyser/polarizer_IMX250MZR.png"


def manifest_of(folder, camera, frames, **keys):
    path = folder / "capture.yaml"
    head = {
        "schema": "reflectance_fit/capture/1",
        "sample": {"name": "scene"},
        "camera": camera,
        "geometry": {"kind": "stated", "s_axis_deg": 0},
        "nuisances": {},
    }
    path.write_text(json.dumps(head | keys | {"frames": frames}))
    return path


@pytest.mark.parametrize(("layout", "sense"), [(LAYOUT, 1), (MIRRORED, -1)])
def test_the_discs_of_the_imx250_have_their_directions(mosaic, tmp_path, layout, sense):
    """Through the whole reading: the rows of the four axes give each disc's angle of polarization."""
    for disc, expected in zip(DISCS, AOLP_DEG, strict=True):
        folder = tmp_path / str(disc[0])
        folder.mkdir()
        shutil.copy(mosaic, folder / "a.png")
        camera = {
            "sensor": "dofp",
            "dofp_layout_deg": layout,
            "encoding": "linear",
            "channels": {"grey": {"wavelength_nm": 550}},
        }
        frame = {"file": "a.png", "theta_deg": 45, "exposure_s": 0.01}
        found = ingest(read_capture(manifest_of(folder, camera, [frame], region=disc)))
        rows = found.measurement.observations
        assert sorted(rows.analyzer_deg) == [0.0, 45.0, 90.0, 135.0]
        light = fit_stokes(rows.value, 1.0, np.radians(rows.analyzer_deg))
        assert math.degrees(light.aolp) == pytest.approx(sense * expected, abs=0.5)


@pytest.mark.parametrize(("layout", "sense"), [(LAYOUT, 1), (MIRRORED, -1)])
def test_the_same_of_every_cell_by_itself(mosaic, layout, sense):
    frame = read_frame(mosaic, Reading("dofp", layout, encoding="linear"))
    axes = [frame.plane(y, x).axis_deg for y, x in np.ndindex(2, 2)]
    for (x0, y0, x1, y1), expected in zip(DISCS, AOLP_DEG, strict=True):
        cells = [frame.cfa[y0 + y : y1 : 2, x0 + x : x1 : 2].astype(float) for y, x in np.ndindex(2, 2)]
        # Codes of a tone curve contradict one another, so weights of shot noise would move the angle.
        found = fit_stokes(np.stack(cells), 1.0, np.radians(axes))
        assert np.degrees(np.median(found.aolp)) == pytest.approx(sense * expected, abs=0.5)


def test_the_imbalance_betrays_the_tone_curve_of_the_8_bit_file(mosaic, tmp_path):
    """Read as linear the crossed pairs of a polarizing film differ by 9 to 14 %, by the curve of sRGB by 3 %."""
    worst = {}
    for encoding in ("linear", "srgb"):
        frame = read_frame(mosaic, Reading("dofp", LAYOUT, encoding=encoding))
        found = []
        for disc in DISCS:
            means = reduce_frame(frame, (Region(*disc),)).over(Region(*disc))
            axes = [plane.axis_deg for plane in means]
            found.append(
                float(redundancy([m.mean[0] for m in means.values()], 1.0, np.radians(axes)).imbalance)
            )
        worst[encoding] = found
    assert np.abs(worst["linear"]).min() > 0.08
    # Its sign is that of the film's direction: no gain of a pixel does that.
    assert np.sign(worst["linear"]).tolist() == [-1, 1, -1, 1]
    assert np.abs(worst["srgb"]).max() < 0.04


@pytest.mark.parametrize("scene", ["scene000", "scene001"])
def test_sony_dolpcc_reports_its_imbalance(data, tmp_path, scene):
    """Four photographs of one scene, linear, through a polarizer at 0, 45, 90 and 135: I0 + I90 is 2 % low."""
    frames, expected = [], []
    for axis in (0, 45, 90, 135):
        picture = cv2.imread(
            str(data / f"polarization/sony_dolpcc/{scene}_i{axis:03d}.png"), cv2.IMREAD_UNCHANGED
        )
        green = picture[..., 1]
        expected.append(green.mean())
        cv2.imwrite(str(tmp_path / f"{axis}.png"), green)
        frames.append({"file": f"{axis}.png", "theta_deg": 45, "analyzer_deg": axis, "exposure_s": 0.01})
    camera = {
        "sensor": "mono",
        "encoding": "linear",
        "channels": {"G": {"wavelength_nm": 550}},
        "noise": {"gain_e_per_dn": 1, "read_noise_e": 10},
    }
    # Where nothing is clipped.
    found = ingest(read_capture(manifest_of(tmp_path, camera, frames, region=[20, 200, 200, 400])))
    told = [note.message for note in found.measurement.warnings if note.code == "IMBALANCE"]
    assert len(told) == 1
    worst = float(re.search(r"worst ([+-][0-9.]+) %", told[0])[1])
    assert worst == pytest.approx(-2.2, abs=0.1)
    ratio = (expected[0] + expected[2]) / (expected[1] + expected[3])
    assert ratio == pytest.approx(0.977, abs=0.001)


def test_polcams_maps_are_taken_and_only_for_pictures_of_their_size(data, tmp_path):
    folder = data / "polarization/polcam_sr"
    offset, gain = read_map(folder / "offset.tif"), read_map(folder / "gain.tif")
    assert offset.shape == gain.shape == (135, 189)
    maps = checked_maps(offset, gain, (135, 189), ("offset", "gain"))
    # Both are even: 100 DN, and 0.42 electrons a DN, of which only ratios count.
    assert np.all(maps.offset == 100)
    assert np.all(maps.gain == 1)
    with pytest.raises(ReflectanceFitError, match="189 x 135 pixels and the photographs are of 190 x 135"):
        checked_maps(offset, gain, (135, 190), ("offset", "gain"))


def test_polcams_maps_act_in_a_capture(data, tmp_path):
    generator = np.random.default_rng(3)
    light = generator.uniform(500, 3000, (135, 189))
    cv2.imwrite(str(tmp_path / "a.tif"), np.rint(light + 100).astype(np.uint16))
    for name in ("offset.tif", "gain.tif"):
        shutil.copy(data / "polarization/polcam_sr" / name, tmp_path / name)
    camera = {
        "sensor": "dofp",
        "dofp_layout_deg": LAYOUT,
        "encoding": "linear",
        "channels": {"laser": {"wavelength_nm": 640}},
        "offset_map": "offset.tif",
        "gain_map": "gain.tif",
    }
    path = manifest_of(tmp_path, camera, [{"file": "a.tif", "theta_deg": 45, "exposure_s": 1}])
    found = ingest(read_capture(path))
    rows = found.measurement.observations
    for y, x in np.ndindex(2, 2):
        mine = rows.value[rows.analyzer_deg == LAYOUT[y][x]]
        assert mine == pytest.approx([light[y::2, x::2].mean()], abs=0.1)
    assert [name for name, _ in found.measurement.inputs] == [
        "capture.yaml",
        "offset.tif",
        "gain.tif",
        "a.tif",
    ]
    assert Plane("laser", 0.0) in found.samples[0].signals
