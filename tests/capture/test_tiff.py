"""Tags are exact, structure is checked, and hostile bytes cost an error at most."""

import contextlib
import struct
import time
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st

from reflectance_fit.capture.raw import decode
from reflectance_fit.capture.reading import Reading, read_frame
from reflectance_fit.capture.structure import check_structure
from reflectance_fit.capture.tiff import CFA, read_tags
from reflectance_fit.errors import ReflectanceFitError

RATIONAL, DOUBLE, FLOAT, BYTE, ASCII, SHORT, LONG, SRATIONAL = 5, 12, 11, 1, 2, 3, 4, 10
SIZES = {BYTE: "B", ASCII: "B", SHORT: "H", LONG: "I", RATIONAL: "I", SRATIONAL: "i", FLOAT: "f", DOUBLE: "d"}


def build(tags: dict, *, endian="<", exif=None, sub=None, pixels=b"", extra=b"") -> bytes:
    """A TIFF: IFD0, an Exif IFD, one SubIFD, then pixels.  A value "pixels" stands for their offset."""
    at = 8
    parts = []
    ifds = [dict(tags)] + [dict(d) for d in (exif, sub) if d is not None]
    lengths = [len(encode(d, 0, endian, 0)) for d in with_pointers(ifds, exif, sub, [0, 0, 0])]
    starts = [at + sum(lengths[:i]) for i in range(len(lengths))]
    pixels_at = at + sum(lengths)
    for start, ifd in zip(starts, with_pointers(ifds, exif, sub, starts), strict=True):
        parts.append(encode(ifd, start, endian, pixels_at))
    head = (b"II" if endian == "<" else b"MM") + struct.pack(endian + "HI", 42, 8)
    return head + b"".join(parts) + pixels + extra


def with_pointers(ifds, exif, sub, starts):
    first = dict(ifds[0])
    at = 1
    for tag, given_ in ((34665, exif), (330, sub)):
        if given_ is not None:
            first[tag] = (LONG, [starts[at]])
            at += 1
    return [first, *ifds[1:]]


def encode(tags: dict, start: int, endian: str, pixels_at: int) -> bytes:
    fixed, values = struct.pack(endian + "H", len(tags)), b""
    base = start + 2 + 12 * len(tags) + 4
    for tag, (kind, numbers) in sorted(tags.items()):
        numbers = [pixels_at if n == "pixels" else n for n in numbers]
        data = struct.pack(f"{endian}{len(numbers)}{SIZES[kind]}", *numbers)
        count = len(numbers) // (2 if kind in (RATIONAL, SRATIONAL) else 1)
        fixed += struct.pack(endian + "HHI", tag, kind, count)
        if len(data) > 4:
            fixed += struct.pack(endian + "I", base + len(values))
            values += data
        else:
            fixed += data.ljust(4, b"\0")
    return fixed + b"\0\0\0\0" + values


def image(**changes) -> dict:
    """Tags of a 64 x 48 uncompressed 16-bit Bayer image, little-endian layout; ``t256=None`` leaves one out, ``t256=(type, values)`` sets one."""
    tags = {
        254: (LONG, [0]),
        256: (LONG, [64]),
        257: (LONG, [48]),
        258: (SHORT, [16]),
        259: (SHORT, [1]),
        262: (SHORT, [CFA]),
        273: (LONG, ["pixels"]),
        277: (SHORT, [1]),
        278: (LONG, [48]),
        279: (LONG, [64 * 48 * 2]),
        33421: (SHORT, [2, 2]),
        33422: (BYTE, [0, 1, 1, 2]),
        50706: (BYTE, [1, 4, 0, 0]),
        50714: (SHORT, [100]),
        50717: (SHORT, [60000]),
    }
    for key, value in changes.items():
        if value is None:
            tags.pop(int(key[1:]), None)
        else:
            tags[int(key[1:])] = value
    return tags


PIXELS = np.random.default_rng(0).integers(0, 2**16, (48, 64), dtype="<u2")


@pytest.fixture
def write(tmp_path):
    def write(data: bytes, name: str = "a.dng") -> Path:
        (tmp_path / name).write_bytes(data)
        return tmp_path / name

    return write


def tags_of(path: Path):
    tags = read_tags(path)
    check_structure(tags, path.name)
    return tags


def refusal(path: Path) -> str:
    with pytest.raises(ReflectanceFitError) as caught:
        tags_of(path)
    (problem,) = caught.value.problems
    assert problem.file.endswith(path.name)
    assert "\n" not in problem.message
    return problem.message


@pytest.mark.parametrize("endian", ["<", ">"])
def test_values_are_exact_in_both_byte_orders(write, endian):
    tags = image(
        t50713=(SHORT, [2, 2]),
        t50714=(RATIONAL, [513, 2, 256, 1, 1025, 4, 1, 3]),
        t274=(SHORT, [6]),
        t51041=(DOUBLE, [1e-4, 1e-7, 2e-4, 2e-7, 3e-4, 3e-7]),
    )
    exif = {33434: (RATIONAL, [10, 1250]), 34855: (SHORT, [3200])}
    found = tags_of(
        path := write(build(tags, endian=endian, exif=exif, pixels=PIXELS.astype(endian + "u2").tobytes()))
    )
    assert found.dng
    assert (found.exposure_s, found.iso, found.orientation) == (Fraction(1, 125), 3200, 6)
    assert (found.image.photometric, found.image.bits, found.image.cfa_pattern) == (CFA, (16,), (0, 1, 1, 2))
    assert found.image.black == (Fraction(513, 2), 256, Fraction(1025, 4), Fraction(1, 3))
    assert found.image.noise_profile == ((1e-4, 1e-7), (2e-4, 2e-7), (3e-4, 3e-7))
    assert found.image.extents == ((path.stat().st_size - PIXELS.nbytes, PIXELS.nbytes),)
    frame = decode(path)
    np.testing.assert_array_equal(frame.cfa, PIXELS)
    # LibRaw would say 256, 256, 256, 0.
    assert frame.black.tolist() == [[256.5, 256], [256.25, 1 / 3]]


def test_the_raw_image_is_found_in_a_sub_directory(write):
    sub = image()
    preview = {256: (LONG, [8]), 257: (LONG, [8]), 262: (SHORT, [2]), 50706: (BYTE, [1, 4, 0, 0])}
    preview[51041] = (DOUBLE, [1e-4, 0.0])
    found = tags_of(write(build(preview, sub=sub, pixels=PIXELS.tobytes())))
    assert (found.image.width, found.image.height) == (64, 48)
    assert found.image.noise_profile == ((1e-4, 0.0),)


def test_a_preview_of_raw_kind_is_passed_over(write):
    preview = image(t254=(LONG, [1]))
    found = tags_of(write(build(preview, sub=image(t256=(LONG, [32])), pixels=PIXELS.tobytes())))
    assert found.image.width == 32


def test_black_is_told_from_the_top_left_of_the_active_area(write):
    # LibRaw rounds a margin of 3 rows up to 4: the visible area starts at the cell's second row.
    tags = image(t50713=(SHORT, [2, 2]), t50714=(LONG, [1, 2, 3, 4]), t50829=(LONG, [3, 2, 47, 62]))
    frame = decode(write(build(tags, pixels=PIXELS.tobytes())))
    row = int(np.flatnonzero(PIXELS[:, 2] == frame.cfa[0, 0])[0])
    assert row == 4
    assert frame.black.tolist() == [[3, 4], [1, 2]]


def test_black_that_repeats_over_columns_only(write):
    tags = image(t50713=(SHORT, [1, 2]), t50714=(LONG, [7, 9]))
    assert decode(write(build(tags, pixels=PIXELS.tobytes()))).black.tolist() == [[7, 9], [7, 9]]


def test_black_with_deltas_is_libraws(write):
    tags = image(t50715=(SRATIONAL, [4, 1] * 64))
    assert decode(write(build(tags, pixels=PIXELS.tobytes()))).black.tolist() == [[104, 104], [104, 104]]


@pytest.mark.parametrize("exposure", [[0, 1_000_000], [1, 0], [0, 0]])
def test_exposures_that_mean_unknown(write, exposure):
    found = tags_of(write(build(image(), exif={33434: (RATIONAL, exposure)}, pixels=PIXELS.tobytes())))
    assert found.exposure_s is None
    assert found.iso is None


def test_exposure_beside_the_image(write):
    tags = image(t33434=(RATIONAL, [1, 50]), t34855=(SHORT, [80]))
    found = tags_of(write(build(tags, pixels=PIXELS.tobytes())))
    assert (found.exposure_s, found.iso) == (Fraction(1, 50), 80)


@pytest.mark.parametrize(
    "profile", [[1e-4], [0.0, 0.0], [1e-4, -1.0], [float("nan"), 0.0], [float("inf"), 0.0], [1e-4, 0.0] * 4]
)
def test_noise_profiles_that_are_none(write, profile):
    found = tags_of(write(build(image(t51041=(DOUBLE, profile)), pixels=PIXELS.tobytes())))
    assert found.image.noise_profile is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"t339": (SHORT, [3])}, "floating-point"),
        ({"t33421": (SHORT, [4, 4]), "t33422": (BYTE, [0, 0, 1, 1] * 4)}, "4 x 4"),
        ({"t277": (SHORT, [3]), "t50714": None}, "demosaiced"),
        ({"t33421": (SHORT, [6, 6]), "t33422": (BYTE, [0, 1, 1, 2, 1, 1] * 6)}, "X-Trans"),
        ({"t50711": (SHORT, [2])}, "staggered"),
        ({"t262": (SHORT, [34892]), "t277": (SHORT, [3]), "t50714": None}, "linear RGB"),
        ({"t50885": (LONG, [4])}, "sRAW"),
        ({"t259": (SHORT, [34892])}, "34892 is lossy JPEG"),
        ({"t259": (SHORT, [52546])}, "JPEG XL, which may be lossy"),
        ({"t259": (SHORT, [12345])}, "12345 is not known"),
        ({"t259": (SHORT, [7])}, "is no JPEG"),
        ({"t258": (SHORT, [32])}, "bits"),
        ({"t50713": (SHORT, [4, 1]), "t50714": (SHORT, [1, 2, 3, 4])}, "4 x 1"),
        ({"t279": (LONG, [6143])}, "too short"),
        ({"t278": (LONG, [24])}, "1 of 2 pieces"),
        ({"t279": (LONG, [6144, 6144])}, "different numbers"),
        (dict.fromkeys((f"t{tag}" for tag in range(60_000, 61_025)), (SHORT, [0])), "entries"),
        ({"t273": (LONG, [5000])}, "cut off"),
        ({"t262": (SHORT, [2]), "t50706": None}, "plain TIFF"),
        ({"t262": (SHORT, [1])}, "plain TIFF"),
        ({"t256": (LONG, [0])}, "no width"),
        ({"t278": (LONG, [0])}, "no width"),
        ({"t50713": (SHORT, [2, 2])}, "BlackLevel"),
        ({"t50714": (RATIONAL, [1, 0, 1, 1])}, "zero denominator"),
        ({"t256": (DOUBLE, [64.0])}, "256"),
        ({"t330": (LONG, [8])}, "loop"),
        ({"t330": (LONG, [10**9])}, "outside the file"),
        ({"t330": (LONG, list(range(100)))}, "100 values"),
    ],
)
def test_what_is_refused(write, changes, message):
    assert message in refusal(write(build(image(**changes), pixels=PIXELS.tobytes())))


def tiled(rows: int, columns: int, pieces: int) -> bytes:
    size = rows * columns * 2
    offsets = ["pixels"] * pieces
    tags = image(t273=None, t278=None, t279=None)
    tags |= {322: (LONG, [columns]), 323: (LONG, [rows])}
    tags |= {324: (LONG, offsets), 325: (LONG, [size] * pieces)}
    return build(tags, pixels=bytes(range(256)) * (size // 256))


def test_tiles(write):
    tags_of(write(tiled(32, 32, 4)))
    assert "larger than the image" in refusal(write(tiled(64, 64, 1)))
    assert "larger than the image" in refusal(write(tiled(16, 128, 3)))
    assert "3 of 4 pieces" in refusal(write(tiled(32, 32, 3)))


def test_files_that_are_something_else(write, tmp_path):
    assert "empty" in refusal(write(b""))
    assert "JPEG" in refusal(write(b"\xff\xd8\xff\xe0" + bytes(100)))
    assert "no header of a raw format" in refusal(write(bytes(1000)))
    assert "BigTIFF" in refusal(write(b"II+\0\x08\0\0\0" + bytes(100)))
    assert "Foveon" in refusal(write(b"FOVb" + bytes(100)))
    assert "is a PNG" in refusal(write(b"\x89PNG\r\n\x1a\n" + bytes(100)))
    assert "cut off" in refusal(write(b"II*\0"))
    assert "no such file" in refusal(tmp_path / "none.dng")
    assert "no ordinary file" in refusal(tmp_path)
    assert "no ordinary file" in refusal(Path("/dev/zero"))


def test_a_file_that_may_not_be_read(write, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    path = write(BASE)
    monkeypatch.setattr(Path, "open", refuse)
    assert refusal(path) == "cannot be read: Permission denied"


def test_a_picture_of_one_value(write):
    for value in (0, 300):
        path = write(build(image(), pixels=np.full((48, 64), value, "<u2").tobytes()))
        with pytest.raises(ReflectanceFitError, match=f"every pixel is {value}"):
            decode(path)


@pytest.mark.parametrize("white", [100, 50, 0])
def test_white_not_above_black(write, white):
    path = write(build(image(t50717=(SHORT, [white])), pixels=PIXELS.tobytes()))
    with pytest.raises(ReflectanceFitError, match=f"black level 100 is not below its white level {white}"):
        read_frame(path, Reading())


def test_a_plain_tiff_that_libraw_takes_for_raw(tmp_path):
    tifffile.imwrite(tmp_path / "a.dng", PIXELS)
    assert "plain TIFF" in refusal(tmp_path / "a.dng")


def test_lossless_jpeg_and_its_cut_files(tmp_path):
    """LibRaw fills what is missing of a lossless JPEG with zeros and says nothing."""
    pixels = PIXELS >> 2
    tifffile.imwrite(
        tmp_path / "a.dng",
        pixels,
        photometric="cfa",
        compression=7,
        compressionargs={"lossless": True, "bitspersample": 14},
        subfiletype=0,
        rowsperstrip=48,
        extratags=[
            (33421, SHORT, 2, (2, 2), True),
            (33422, BYTE, 4, bytes([0, 1, 1, 2]), True),
            (50706, BYTE, 4, bytes([1, 4, 0, 0]), True),
            (50717, SHORT, 1, 16383, True),
        ],
    )
    np.testing.assert_array_equal(decode(tmp_path / "a.dng").cfa, pixels)
    whole = (tmp_path / "a.dng").read_bytes()
    for length in range(600, len(whole), 97):
        (tmp_path / "cut.dng").write_bytes(whole[:length])
        assert refusal(tmp_path / "cut.dng")


def lossless(height: int, width: int, marker: int = 0xC3) -> bytes:
    """The segments before the data of a JPEG of one component, after a comment."""
    frame = struct.pack(">BHHB", 14, height, width, 1) + b"\0\x11\0"
    segments = ((0xFE, b"made for a test"), (marker, frame), (0xDA, b"\1\0\0\1\0\0"))
    coded = (struct.pack(">BBH", 0xFF, m, len(b) + 2) + b for m, b in segments)
    return b"\xff\xd8" + b"".join(coded) + bytes(64)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (lossless(48, 64), None),
        (lossless(24, 128), None),  # two rows of the sensor in one of the JPEG
        (lossless(48, 63), "too short"),
        (lossless(48, 64, 0xC0), "JPEG compression is lossy"),
        (lossless(48, 64, 0xC1), "JPEG compression is lossy"),
        (lossless(48, 64, 0xC4), "is no JPEG"),  # a Huffman table is no frame
        (lossless(48, 64)[:30], "is no JPEG"),
        (lossless(48, 64)[2:], "is no JPEG"),
        (b"\xff\xd8" + 70 * b"\xff\xfe\0\2" + lossless(48, 64)[2:], "is no JPEG"),
    ],
)
def test_the_header_of_a_jpeg_inside(write, data, message):
    path = write(build(image(t259=(SHORT, [7]), t279=(LONG, [len(data)])), pixels=data))
    if message is None:
        (jpeg,) = tags_of(path).image.jpegs
        assert jpeg == (True, 14, 48 * 64)
    else:
        assert message in refusal(path)


def test_masked_areas(write):
    tags = image(t50829=(LONG, [4, 8, 48, 64]), t50830=(LONG, [0, 0, 4, 64, 4, 0, 48, 8]))
    found = tags_of(write(build(tags, pixels=PIXELS.tobytes()))).image
    assert found.masked == ((0, 0, 4, 64), (4, 0, 48, 8))
    assert found.active_origin == (4, 8)
    assert tags_of(write(build(image(t50830=(LONG, [0, 0, 4])), pixels=PIXELS.tobytes()))).image.masked == ()


BASE = build(
    image(t50713=(SHORT, [2, 2]), t50714=(RATIONAL, [1, 1] * 4), t51041=(DOUBLE, [1e-4, 0.0])),
    exif={33434: (RATIONAL, [1, 50]), 34855: (SHORT, [80])},
    sub=image(),
    pixels=PIXELS.tobytes(),
)
HEADER = len(BASE) - PIXELS.nbytes


def survives(folder: Path, data: bytes) -> None:
    path = folder / "a.dng"
    path.write_bytes(data)
    start = time.perf_counter()
    with contextlib.suppress(ReflectanceFitError):
        tags_of(path)
    assert time.perf_counter() - start < 1


def test_cut_at_every_byte_of_the_header(tmp_path):
    for length in range(HEADER):
        (tmp_path / "a.dng").write_bytes(BASE[:length])
        assert refusal(tmp_path / "a.dng")


@settings(max_examples=1500)
@given(
    changes=st.lists(st.tuples(st.integers(0, HEADER - 1), st.integers(0, 255)), max_size=6),
    words=st.lists(
        st.tuples(
            st.integers(0, HEADER - 4),
            st.sampled_from([0, 1, 8, 2**16 - 1, 2**31 - 1, 2**32 - 1, HEADER, len(BASE)]),
        ),
        max_size=3,
    ),
    length=st.one_of(st.none(), st.integers(0, len(BASE))),
)
def test_damaged_bytes(tmp_path_factory, changes, words, length):
    data = bytearray(BASE)
    for at, value in changes:
        data[at] = value
    for at, value in words:
        data[at : at + 4] = struct.pack("<I", value)
    survives(tmp_path_factory.getbasetemp(), bytes(data[:length]))


@settings(max_examples=300)
@given(tail=st.binary(max_size=400), endian=st.sampled_from([b"II*\0", b"MM\0*"]))
def test_any_bytes_after_the_header(tmp_path_factory, tail, endian):
    survives(tmp_path_factory.getbasetemp(), endian + tail)


def test_the_worst_that_fits_the_limits_is_soon_read(tmp_path):
    """As many directories, entries and strips as are allowed."""
    tags = image(t273=(LONG, [0] * 100_000), t279=(LONG, [0] * 100_000), t278=(LONG, [1]))
    full = {tag: (SHORT, [0]) for tag in range(20_000, 21_023)} | {254: (LONG, [1])}
    sub = encode(full, 0, "<", 0)
    start = len(build(tags | {330: (LONG, [0] * 63)}))
    data = build(tags | {330: (LONG, [start + i * len(sub) for i in range(63)])}, extra=sub * 63)
    survives(tmp_path, data)
    assert "48 pieces" in refusal(tmp_path / "a.dng")
