"""Pixels as a PNG, faster and smaller than with the filters that photographs need."""

import zlib
from struct import pack
from typing import Any

import numpy as np

SIGNATURE, TRUE_COLOUR = b"\x89PNG\r\n\x1a\n", 2
LEVEL = 1  # of 9: 9 makes drawings a fifth smaller, in many times the time


def png(picture: Any) -> bytes:
    """An opaque RGBA image (H, W, 4) of bytes as a PNG file, its rows unfiltered (PNG 9.2)."""
    pixels = np.asarray(picture)[..., :3]
    high, wide, channels = pixels.shape
    rows = np.zeros((high, 1 + channels * wide), dtype=np.uint8)
    rows[:, 1:] = pixels.reshape(high, -1)
    header = pack(">IIBBBBB", wide, high, 8, TRUE_COLOUR, 0, 0, 0)
    body = zlib.compress(rows.data, LEVEL)
    return SIGNATURE + chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def chunk(kind: bytes, content: bytes) -> bytes:
    """A part of the file, with its length and checksum."""
    return pack(">I", len(content)) + kind + content + pack(">I", zlib.crc32(kind + content))
