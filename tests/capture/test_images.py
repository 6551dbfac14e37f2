"""Machine-vision pictures: every sample as other writers put it, and a reason for what is none."""

import contextlib
import struct
import zlib

import numpy as np
import pytest
import tifffile
from colour.models import eotf_sRGB
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from reflectance_fit.capture import image_headers
from reflectance_fit.capture.images import decode_samples
from reflectance_fit.errors import ReflectanceFitError

SAMPLES = np.random.default_rng(0).integers(0, 2**16, (46, 70), dtype=np.uint16)
BYTES = (SAMPLES >> 8).astype(np.uint8)


def refusal(path, encoding="linear"):
    with pytest.raises(ReflectanceFitError) as caught:
        decode_samples(path, encoding)
    (problem,) = caught.value.problems
    assert problem.file == str(path)
    assert problem.message.isprintable()
    return problem.message


@pytest.mark.parametrize("samples", [SAMPLES, BYTES], ids=["16", "8"])
def test_png_comes_back(tmp_path, samples):
    Image.fromarray(samples).save(tmp_path / "a.png")
    found, white = decode_samples(tmp_path / "a.png", "linear")
    assert found.dtype == np.uint16
    np.testing.assert_array_equal(found, samples)
    assert white == np.iinfo(samples.dtype).max


@pytest.mark.parametrize(
    "how",
    [
        {},
        {"byteorder": ">"},
        {"tile": (16, 32)},
        {"rowsperstrip": 7},
        {"compression": "lzw", "predictor": True},
        {"compression": "zlib", "predictor": True},
        {"compression": "deflate"},
    ],
)
@pytest.mark.parametrize("samples", [SAMPLES, BYTES], ids=["16", "8"])
def test_tiff_comes_back(tmp_path, samples, how):
    tifffile.imwrite(tmp_path / "a.tif", samples, photometric="minisblack", **how)
    found, white = decode_samples(tmp_path / "a.tif", "linear")
    np.testing.assert_array_equal(found, samples)
    assert white == np.iinfo(samples.dtype).max


def test_notes_in_a_png_change_nothing(tmp_path):
    """Gamma, orientation and resolution are the manifest's business or nobody's."""
    notes = PngInfo()
    notes.add(b"gAMA", struct.pack(">I", 45455))
    exif = Image.Exif()
    exif[274] = 6
    Image.fromarray(BYTES).save(tmp_path / "a.png", pnginfo=notes, exif=exif, dpi=(72, 72))
    np.testing.assert_array_equal(decode_samples(tmp_path / "a.png", "linear")[0], BYTES)


@pytest.mark.parametrize("bits", [8, 16])
def test_the_curve_of_srgb_is_undone(tmp_path, bits):
    codes = np.arange(2**bits, dtype=f"u{bits // 8}").reshape(2 ** (bits // 2), -1)
    Image.fromarray(codes).save(tmp_path / "a.png")
    found, white = decode_samples(tmp_path / "a.png", "srgb")
    assert white == 65535
    np.testing.assert_allclose(found, 65535 * eotf_sRGB(codes / (2**bits - 1)), atol=0.51)


def test_png_that_is_refused(tmp_path):
    path = tmp_path / "a.png"
    for picture, kind in (
        (Image.fromarray(np.stack([BYTES] * 3, axis=-1)), "RGB;"),
        (Image.fromarray(np.stack([BYTES] * 4, axis=-1)), "RGB with alpha"),
        (Image.fromarray(BYTES).convert("LA"), "grey with alpha"),
        (Image.fromarray(BYTES).convert("P"), "a palette"),
        (Image.fromarray(BYTES > 99), "1 bits"),
    ):
        picture.save(path)
        assert kind in refusal(path)
    Image.fromarray(BYTES).save(path, transparency=3)
    assert "partly transparent" in refusal(path)
    Image.fromarray(BYTES).save(path, save_all=True, append_images=[Image.fromarray(BYTES + 1)])
    assert "animated" in refusal(path)


@pytest.mark.parametrize(
    ("samples", "how", "message"),
    [
        (np.stack([SAMPLES] * 3, axis=-1), {"photometric": "rgb"}, "3 samples"),
        (np.stack([SAMPLES] * 3), {"photometric": "rgb", "planarconfig": "separate"}, "3 samples"),
        (np.stack([SAMPLES] * 2), {"photometric": "minisblack"}, "2 pages"),
        (SAMPLES.astype(np.float32), {}, "floating-point"),
        (SAMPLES.view(np.int16), {}, "signed"),
        (SAMPLES.astype(np.uint32), {}, "32 bits"),
        (SAMPLES >> 4, {"bitspersample": 12}, "12 bits"),
        (SAMPLES, {"photometric": "miniswhite"}, "photometric interpretation is 0"),
        (SAMPLES, {"compression": "packbits"}, "compression is 32773"),
        (BYTES, {"compression": "jpeg"}, "compression is 7"),
        (SAMPLES, {"compression": "zstd"}, "compression is 50000"),
        (SAMPLES, {"extratags": [(274, 3, 1, 3, True)]}, "turned or mirrored"),
    ],
)
def test_tiff_that_is_refused(tmp_path, samples, how, message):
    tifffile.imwrite(tmp_path / "a.tif", samples, **how)
    assert message in refusal(tmp_path / "a.tif")


def test_what_is_something_else(tmp_path, monkeypatch):
    path = tmp_path / "a.png"
    assert "there is no such file" in refusal(path)
    assert "is no ordinary file" in refusal(tmp_path)
    for data in (b"", b"\xff\xd8\xff\xe0" + bytes(100), bytes(1000), b"II+\0" + bytes(100)):
        path.write_bytes(data)
        assert "is no PNG or TIFF" in refusal(path)
    Image.fromarray(SAMPLES).save(path)
    monkeypatch.setattr(image_headers, "MAX_PIXELS", SAMPLES.size)
    decode_samples(path, "linear")
    monkeypatch.setattr(image_headers, "MAX_PIXELS", SAMPLES.size - 1)
    assert "70 x 46 pixels" in refusal(path)


def test_a_small_file_that_claims_to_be_huge(tmp_path):
    header = struct.pack(">IIBBBBB", 60_000, 60_000, 16, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(bytes(99))), (b"IEND", b""))
    data = b"".join(
        struct.pack(">I", len(b)) + k + b + struct.pack(">I", zlib.crc32(k + b)) for k, b in chunks
    )
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + data)
    assert "60000 x 60000 pixels" in refusal(tmp_path / "a.png")


@pytest.mark.parametrize("name", ["a.png", "a.tif", "z.tif"])
def test_cut_anywhere(tmp_path, name):
    if name == "a.png":
        Image.fromarray(SAMPLES).save(tmp_path / name)
    else:
        # The tags last, as some writers have it, or first.
        tifffile.imwrite(tmp_path / name, SAMPLES, compression="zlib" if name == "z.tif" else None)
    whole = (tmp_path / name).read_bytes()
    for length in [*range(0, 60, 7), *range(60, len(whole) - 1, 211), len(whole) - 1]:
        (tmp_path / name).write_bytes(whole[:length])
        assert refusal(tmp_path / name)


def test_every_damaged_byte_of_a_png_shows(tmp_path):
    Image.fromarray(SAMPLES[:22, :22]).save(tmp_path / "a.png")
    whole = (tmp_path / "a.png").read_bytes()
    for at in range(0, len(whole), 3):
        damaged = bytearray(whole)
        damaged[at] ^= 0x10
        (tmp_path / "a.png").write_bytes(damaged)
        assert refusal(tmp_path / "a.png")


TAGS = 300  # bytes before the samples, about


@settings(max_examples=300, deadline=None)
@given(changes=st.lists(st.tuples(st.integers(0, TAGS), st.integers(0, 255)), min_size=1, max_size=5))
def test_damaged_tags_of_a_tiff(tmp_path_factory, changes):
    path = tmp_path_factory.getbasetemp() / "a.tif"
    tifffile.imwrite(path, SAMPLES)
    data = bytearray(path.read_bytes())
    for at, value in changes:
        data[at] = value
    path.write_bytes(data)
    with contextlib.suppress(ReflectanceFitError):
        samples, white = decode_samples(path, "linear")
        assert samples.dtype == np.uint16
        assert samples.max() <= white
