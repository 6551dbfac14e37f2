"""Pictures that scenes name come in as linear light, the right way up, or as one line of error."""

import os
import struct

import colour.models
import cv2
import numpy as np
import OpenEXR
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from reflectance_fit.errors import ReflectanceFitError
from reflectance_fit.render.pictures import read_picture
from reflectance_fit.render.scene import ImageEnvironment, Texture
from reflectance_fit.render.scene_file import read_scene

RGB = np.random.default_rng(3).uniform(0, 3, (4, 6, 3)).astype(np.float32)
SCENE = """schema: reflectance_fit/scene/1
camera: {position: [0, -5, 2], target: [0, 0, 1], size_px: [32, 20]}
surfaces:
  - {rectangle: {center: [0, 0, 0], u: [1, 0, 0], v: [0, 1, 0]}, material: {type: lambertian, reflectance: 0.5}}
lights:
  - {type: environment, radiance: 1}
"""


def write_exr(path, **channels):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))


def error(path, encoding=None):
    with pytest.raises(ReflectanceFitError) as caught:
        read_picture(path, "p", encoding)
    (line,) = caught.value.lines()
    return line


def test_exr_as_it_stands(tmp_path):
    write_exr(tmp_path / "p.exr", RGB=RGB)
    assert read_picture(tmp_path / "p.exr", "p", None) == pytest.approx(RGB)


def test_gray_exr(tmp_path):
    write_exr(tmp_path / "p.exr", Y=RGB[:, :, 0].copy())
    assert read_picture(tmp_path / "p.exr", "p", None) == pytest.approx(RGB[:, :, :1])


def test_hdr_to_its_8_bits(tmp_path):
    cv2.imwrite(str(tmp_path / "p.hdr"), RGB[:, :, ::-1])
    assert read_picture(tmp_path / "p.hdr", "p", None) == pytest.approx(RGB, abs=3 / 128)


@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, 255), (np.uint16, 65535)])
def test_png_by_its_encoding(tmp_path, dtype, white):
    samples = np.random.default_rng(4).integers(0, white, (4, 6, 3), endpoint=True).astype(dtype)
    cv2.imwrite(str(tmp_path / "p.png"), samples[:, :, ::-1])
    assert read_picture(tmp_path / "p.png", "p", "linear") == pytest.approx(samples / white)
    due = colour.models.eotf_sRGB(samples / white)
    assert read_picture(tmp_path / "p.png", "p", "srgb") == pytest.approx(due, abs=1e-7)


def test_gray_png(tmp_path):
    cv2.imwrite(str(tmp_path / "p.png"), np.array([[0, 51, 255]], np.uint8))
    found = read_picture(tmp_path / "p.png", "p", "linear")
    assert found.shape == (1, 3, 1)
    assert found.ravel() == pytest.approx([0, 0.2, 1])


def test_a_png_must_say_how_it_follows_light(tmp_path):
    cv2.imwrite(str(tmp_path / "p.png"), np.zeros((2, 2, 3), np.uint8))
    assert "say encoding: srgb" in error(tmp_path / "p.png")
    write_exr(tmp_path / "p.exr", RGB=RGB)
    assert "remove encoding" in error(tmp_path / "p.exr", "srgb")


def test_pictures_that_are_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((2, 2, 4), np.uint8))
    assert "transparency" in error(tmp_path / "a.png", "srgb")
    for bad in (np.nan, np.inf, -0.5):
        pixels = RGB.copy()
        pixels[1, 1, 1] = bad
        write_exr(tmp_path / "p.exr", RGB=pixels)
        assert "negative or not finite" in error(tmp_path / "p.exr")
    write_exr(tmp_path / "p.exr", Z=RGB[:, :, 0].copy())
    assert "neither channels R, G and B" in error(tmp_path / "p.exr")
    (tmp_path / "p").write_bytes(b"GIF89a")
    assert "is no EXR, HDR or PNG" in error(tmp_path / "p")
    (tmp_path / "p").write_bytes(b"")
    assert "is no EXR, HDR or PNG" in error(tmp_path / "p")
    os.mkfifo(tmp_path / "fifo")
    assert "is not a regular file" in error(tmp_path / "fifo")


def test_giants_are_refused_before_they_are_decoded(tmp_path):
    ihdr = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 100_000, 100_000) + b"\x08\x02\0\0\0"
    (tmp_path / "p").write_bytes(ihdr)
    assert (
        error(tmp_path / "p", "srgb") == "Error: p: has 100000 x 100000 pixels; 33554432 in all are the most"
    )
    (tmp_path / "p").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 99999 +X 99999\n")
    assert "99999 x 99999" in error(tmp_path / "p")
    write_exr(tmp_path / "p.exr", RGB=RGB)
    raw = (tmp_path / "p.exr").read_bytes()
    window = struct.pack("<4i", 0, 0, 5, 3)
    assert raw.count(window) == 2
    (tmp_path / "p").write_bytes(raw.replace(window, struct.pack("<4i", 0, 0, 99_999, 99_999)))
    assert error(tmp_path / "p").startswith("Error: p: ")


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(["p.exr", "p.hdr", "p.png"]), st.data())
def test_damaged_pictures_never_raise_anything_else(tmp_path, name, data):
    pristine = tmp_path / f"good-{name}"
    if not pristine.exists():
        if name == "p.exr":
            write_exr(pristine, RGB=RGB)
        else:
            cv2.imwrite(
                str(pristine), RGB if name == "p.hdr" else np.arange(72, dtype=np.uint8).reshape(4, 6, 3)
            )
    raw = bytearray(pristine.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    (tmp_path / name).write_bytes(
        raw[: data.draw(st.integers(0, len(raw)))] if data.draw(st.booleans()) else raw
    )
    try:
        found = read_picture(tmp_path / name, name, "srgb" if name == "p.png" else None)
        assert found.shape[2] in (1, 3)
    except ReflectanceFitError as problem:
        (line,) = problem.lines()
        assert line.startswith(f"Error: {name}: ")


def scene_with(folder, text):
    (folder / "s.yaml").write_text(text)
    return read_scene(folder / "s.yaml", lambda path: pytest.fail("no report here")).scene


def test_surroundings_from_a_picture(tmp_path):
    write_exr(tmp_path / "sky.exr", RGB=RGB)
    write_exr(tmp_path / "gray.exr", Y=RGB[:, :, 0].copy())
    (sky,) = scene_with(tmp_path, SCENE.replace("radiance: 1", "image: sky.exr, scale: 2")).lights
    assert isinstance(sky, ImageEnvironment)
    assert sky.scale == 2
    assert sky.pixels == pytest.approx(RGB)
    (gray,) = scene_with(tmp_path, SCENE.replace("radiance: 1", "image: gray.exr")).lights
    assert gray.pixels.shape == (4, 6, 3)
    assert gray.scale == 1


def test_a_texture(tmp_path):
    write_exr(tmp_path / "wood.exr", RGB=RGB / 3)
    text = SCENE.replace("reflectance: 0.5", "reflectance: {texture: wood.exr}")
    texture = scene_with(tmp_path, text).surfaces[0].material.reflectance
    assert isinstance(texture, Texture)
    assert texture.pixels == pytest.approx(RGB / 3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("radiance: 1", "image: dark.exr", "6: lights.0: dark.exr: is black all over"),
        ("radiance: 1", "radiance: 1, scale: 2", "6: lights.0: encoding and scale go with image"),
        ("radiance: 1", "image: bright.exr, encoding: srgb", "6: lights.0: bright.exr: is linear as it stands"),
        ("reflectance: 0.5", "reflectance: {texture: bright.exr}", "4: surfaces.0.material: bright.exr: a reflectance is at most 1"),
        ("reflectance: 0.5", "reflectance: {texture: ../bright.exr}", "4: surfaces.0.material: '../bright.exr' leads outside"),
        ("rectangle: {center: [0, 0, 0], u: [1, 0, 0], v: [0, 1, 0]}", "sphere: {center: [0, 0, 0], radius: 1}", None),
    ],
)  # fmt: skip
def test_a_mistake_about_a_picture_is_one_line(tmp_path, old, new, message):
    write_exr(tmp_path / "dark.exr", RGB=RGB * 0)
    write_exr(tmp_path / "bright.exr", RGB=RGB)
    text = SCENE.replace(old, new)
    if message is None:
        text = text.replace("reflectance: 0.5", "reflectance: {texture: dark.exr}")
        message = "4: surfaces.0.material: a texture is laid over a rectangle"
    with pytest.raises(ReflectanceFitError) as caught:
        scene_with(tmp_path, text)
    (line,) = (line.replace(f"{tmp_path}{os.sep}", "") for line in caught.value.lines())
    assert line.startswith(f"Error: s.yaml:{message}")
