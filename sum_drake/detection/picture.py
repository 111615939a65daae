"""Reading a user's picture, and the depth that goes with it. What cannot be used is refused in one line.

The files are PNG or JPEG. Their headers are read here, before anything is decoded: decoders let some broken files
through, say what is wrong with others on the terminal, and take any size for granted.
"""

import dataclasses
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake.assets import InputError, one_line

LEAST_SIDE, LARGEST_SIDE = 160, 4096
"""Pixels. Below, an object is a few pixels wide; the detector scales what is within."""
_EXPECTED = "expected a colour picture, PNG or JPEG of 8 bits a channel"


def read_picture(path: Path) -> NDArray[np.uint8]:
    """A colour picture (h, w, 3), RGB, with sides of 160 to 4096 pixels, upright where the file says how it was held.

    An alpha channel that is opaque throughout is dropped. One that is not is refused: what lies beneath is not to be
    seen. Raises InputError for anything else that is no such picture: missing, no picture, cut off, damaged, grey,
    CMYK, of 16 bits, too small, too large.
    """
    data = _read(path, _EXPECTED)
    header = _header(data, path)
    if header.bits != 8:
        raise InputError(f"{path}: has {header.bits} bits a channel; {_EXPECTED}")
    if header.channels not in (3, 4):
        raise InputError(f"{path}: is grey; {_EXPECTED}")
    if header.kind == "JPEG" and header.channels == 4:
        raise InputError(f"{path}: is in CMYK; {_EXPECTED}")
    if min(header.width, header.height) < LEAST_SIDE or max(header.width, header.height) > LARGEST_SIDE:
        raise InputError(
            f"{path}: is {header.width} x {header.height} pixels; expected {LEAST_SIDE} to {LARGEST_SIDE} a side"
        )
    # IMREAD_COLOR alone turns a JPEG as its EXIF orientation says; IMREAD_UNCHANGED alone keeps an alpha channel.
    picture = _decode(data, path, cv2.IMREAD_UNCHANGED if header.kind == "PNG" else cv2.IMREAD_COLOR)
    if picture.shape[2:] == (4,):
        if picture[..., 3].min() < 255:
            raise InputError(f"{path}: is transparent in places; {_EXPECTED}, opaque")
        picture = picture[..., :3]
    return np.ascontiguousarray(picture[..., ::-1], dtype=np.uint8)


def read_depth(path: Path, size: tuple[int, int], *, scale: float = 0.001) -> NDArray[np.float32]:
    """Depth (h, w) in metres, 0 where it is missing, from a PNG of 16 bits.

    Args:
        size: (h, w) of its picture.
        scale: metres a unit; cameras mostly write millimetres.

    Raises InputError for a file that is none, or of another size.
    """
    expected = "expected depth as a grey PNG of 16 bits"
    data = _read(path, expected)
    header = _header(data, path)
    if (header.kind, header.bits, header.channels) != ("PNG", 16, 1):
        said = f"{header.kind} of {header.bits} bits and {header.channels} channel(s)"
        raise InputError(f"{path}: is a {said}; {expected}")
    if (header.height, header.width) != size:
        raise InputError(
            f"{path}: is {header.width} x {header.height} pixels; expected its picture's {size[1]} x {size[0]}"
        )
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(f"depth scale {scale}: expected metres a unit, more than 0")
    return (_decode(data, path, cv2.IMREAD_UNCHANGED) * scale).astype(np.float32)


@dataclasses.dataclass(frozen=True)
class _Header:
    """What a file says of itself."""

    kind: str
    width: int
    height: int
    bits: int
    channels: int


def _read(path: Path, expected: str) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; {expected}") from error


def _header(data: bytes, path: Path) -> _Header:
    for signature, reader in ((b"\x89PNG\r\n\x1a\n", _png_header), (b"\xff\xd8\xff", _jpeg_header)):
        if data.startswith(signature):
            try:
                return reader(data)
            except (struct.error, IndexError) as error:
                raise InputError(f"{path}: is cut off; expected a whole file") from error
            except ValueError as error:
                raise InputError(f"{path}: is damaged ({error}); expected a whole file") from error
    raise InputError(f"{path}: is no picture; expected PNG or JPEG")


def _png_header(data: bytes) -> _Header:
    """Walks the chunks to the end, checking each one's sum. Raises struct.error where they break off."""
    header, at, kind = None, 8, b""
    while kind != b"IEND":
        length, kind = struct.unpack_from(">I4s", data, at)
        (checksum,) = struct.unpack_from(">I", data, at + 8 + length)
        if zlib.crc32(data[at + 4 : at + 8 + length]) != checksum:
            raise ValueError(f"its {kind.decode(errors='replace')} chunk")
        if kind == b"IHDR":
            width, height, bits, color = struct.unpack_from(">IIBB", data, at + 8)
            # A palette (3) has up to 8 bits to choose among colours of 8 bits.
            channels = {0: 1, 2: 3, 3: 3, 4: 2, 6: 4}.get(color, 0)
            header = _Header("PNG", width, height, 8 if color == 3 else bits, channels)
        at += 12 + length
    if header is None:
        raise ValueError("no header")
    return header


def _jpeg_header(data: bytes) -> _Header:
    """Walks the segments to the first scan and looks for the picture's end. Raises IndexError where there is none."""
    header, at = None, 2
    while True:
        if data[at] != 0xFF:
            raise ValueError("its segments")
        marker = data[at + 1]
        if marker == 0xFF:  # padding
            at += 1
            continue
        if marker == 0xDA:
            break
        (length,) = struct.unpack_from(">H", data, at + 2)
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            bits, height, width, channels = struct.unpack_from(">BHHB", data, at + 4)
            header = _Header("JPEG", width, height, bits, channels)
        at += 2 + length
    if header is None:
        raise ValueError("no header")
    if data.find(b"\xff\xd9", at) < 0:
        raise IndexError("no end of the picture")
    return header


def _decode(data: bytes, path: Path, flags: int) -> NDArray[np.uint8 | np.uint16]:
    """The picture as OpenCV decodes it, whole numbers of whatever width."""
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise InputError(f"{path}: cannot be decoded ({one_line(error)}); expected a whole file") from error
    if picture is None:
        raise InputError(f"{path}: cannot be decoded; expected a whole file")
    return np.asarray(picture)
