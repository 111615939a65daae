import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sum_drake.assets import InputError
from sum_drake.detection.picture import read_depth, read_picture


@pytest.fixture(scope="module")
def picture():
    """(200, 320, 3) RGB: smooth, and its corners told apart."""
    v, u = np.mgrid[:200, :320]
    return np.stack([u * 255 // 320, v * 255 // 200, 255 - u * 255 // 320], -1).astype(np.uint8)


def encoded(suffix, array):
    """RGB or RGBA or grey array as a file's bytes."""
    if array.ndim == 3:
        array = array[..., [2, 1, 0, 3][: array.shape[2]]]
    ok, data = cv2.imencode(suffix, array)
    assert ok
    return data.tobytes()


def refused(tmp_path, content, reader=read_picture, *arguments):
    file = tmp_path / "picture"
    file.write_bytes(content)
    with pytest.raises(InputError) as error:
        reader(file, *arguments)
    line = str(error.value)
    assert "\n" not in line
    assert str(file) in line
    assert "expected" in line
    return line


def test_a_png_is_read_as_it_was_written(tmp_path, picture):
    file = tmp_path / "any name"
    file.write_bytes(encoded(".png", picture))
    read = read_picture(file)
    np.testing.assert_array_equal(read, picture)
    assert read.dtype == np.uint8
    assert read.flags.c_contiguous


@pytest.mark.parametrize("progressive", [0, 1])
def test_a_jpeg_is_read_in_rgb(tmp_path, picture, progressive):
    _, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_PROGRESSIVE, progressive])
    (tmp_path / "p.jpg").write_bytes(data.tobytes())
    assert np.abs(read_picture(tmp_path / "p.jpg").astype(int) - picture).mean() < 3


def test_a_jpeg_held_upside_down_is_turned(tmp_path, picture):
    plain = encoded(".jpg", picture)
    entry = struct.pack(">HHIHH", 0x0112, 3, 1, 3, 0)  # orientation: turned by 180 degrees
    exif = b"Exif\0\0" + b"MM\0*" + struct.pack(">IH", 8, 1) + entry + struct.pack(">I", 0)
    (tmp_path / "p.jpg").write_bytes(plain[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + plain[2:])
    assert np.abs(read_picture(tmp_path / "p.jpg").astype(int) - picture[::-1, ::-1]).mean() < 3


def test_an_opaque_alpha_channel_is_dropped_and_any_other_refused(tmp_path, picture):
    opaque = np.dstack([picture, np.full((200, 320), 255, np.uint8)])
    (tmp_path / "p.png").write_bytes(encoded(".png", opaque))
    np.testing.assert_array_equal(read_picture(tmp_path / "p.png"), picture)
    opaque[10, 10, 3] = 254
    assert "transparent" in refused(tmp_path, encoded(".png", opaque))


def test_a_palette_is_colour(tmp_path, picture):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = zlib.compress(b"".join(b"\0" + bytes([v % 2] * 320) for v in range(200)))
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 320, 200, 8, 3, 0, 0, 0))
    palette = chunk(b"PLTE", bytes([255, 0, 0, 0, 0, 255]))
    content = b"\x89PNG\r\n\x1a\n" + header + palette + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    (tmp_path / "p.png").write_bytes(content)
    read = read_picture(tmp_path / "p.png")
    np.testing.assert_array_equal(read[0, 0], [255, 0, 0])
    np.testing.assert_array_equal(read[1, 0], [0, 0, 255])


def test_other_files_are_named_for_what_they_are(tmp_path, picture):
    grey = picture[..., 0]
    assert "no picture" in refused(tmp_path, b"just some text")
    assert "no picture" in refused(tmp_path, b"")
    assert "no picture" in refused(tmp_path, encoded(".bmp", picture))
    assert "grey" in refused(tmp_path, encoded(".png", grey))
    assert "grey" in refused(tmp_path, encoded(".jpg", grey))
    assert "16 bits" in refused(tmp_path, encoded(".png", picture.astype(np.uint16) * 256))
    assert "16 bits" in refused(tmp_path, encoded(".png", grey.astype(np.uint16) * 256))
    assert "159 x 300" in refused(tmp_path, encoded(".png", np.zeros((300, 159, 3), np.uint8)))
    assert "4097 x 160" in refused(tmp_path, encoded(".jpg", np.zeros((160, 4097, 3), np.uint8)))
    for missing in (tmp_path / "none.png", tmp_path):
        with pytest.raises(InputError, match="expected a colour picture"):
            read_picture(missing)


def test_the_sizes_at_the_limits_are_read(tmp_path):
    for shape in ((160, 4096, 3), (4096, 160, 3)):
        (tmp_path / "p.png").write_bytes(encoded(".png", np.zeros(shape, np.uint8)))
        assert read_picture(tmp_path / "p.png").shape == shape


@given(share=st.floats(0, 1, exclude_max=True))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_a_file_that_breaks_off_is_refused_wherever_it_does(tmp_path, picture, capfd, suffix, share):
    whole = encoded(suffix, picture)
    line = refused(tmp_path, whole[: int(share * len(whole))])
    assert "cut off" in line or "no picture" in line
    assert capfd.readouterr().err == "", "the decoder has nothing to add"


@given(st.integers(33, 10**9), st.integers(1, 255))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
def test_a_png_with_a_changed_byte_is_refused(tmp_path, picture, at, change):
    content = bytearray(encoded(".png", picture))
    content[33 + at % (len(content) - 33)] ^= change
    refused(tmp_path, bytes(content))


def test_depth_is_read_in_metres(tmp_path):
    depth = np.array([[0, 500], [1234, 65535]], np.uint16)
    file = tmp_path / "depth.png"
    file.write_bytes(encoded(".png", depth))
    read = read_depth(file, (2, 2))
    assert read.dtype == np.float32
    np.testing.assert_allclose(read, depth / 1000, rtol=1e-6)
    np.testing.assert_allclose(read_depth(file, (2, 2), scale=0.0001), depth / 10000, rtol=1e-6)


def test_depth_of_another_size_or_kind_is_refused(tmp_path, picture):
    depth = encoded(".png", np.zeros((200, 320), np.uint16))
    assert "expected its picture's 640 x 480" in refused(tmp_path, depth, read_depth, (480, 640))
    assert "8 bits" in refused(tmp_path, encoded(".png", picture[..., 0]), read_depth, (200, 320))
    assert "3 channel" in refused(tmp_path, encoded(".png", picture.astype(np.uint16)), read_depth, (200, 320))
    assert "JPEG" in refused(tmp_path, encoded(".jpg", picture), read_depth, (200, 320))
    file = tmp_path / "depth.png"
    file.write_bytes(depth)
    with pytest.raises(InputError, match="depth scale"):
        read_depth(file, (200, 320), scale=0.0)
