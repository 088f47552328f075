"""A map message as an image: small enough for a journal, and what every browser draws."""

import struct
import zlib
from typing import Any

# Of a greater map not every cell is drawn.
_CELLS = 4_000_000
# As map_saver draws: white where it is free, black where it is occupied, and a grey for what is not known.
_UNKNOWN = 205
_GREY = bytes(254 - 254 * cell // 100 if cell <= 100 else _UNKNOWN for cell in range(256))  # noqa: PLR2004


def grid_image(message: Any) -> tuple[int, int, int, bytes] | None:
    """Return a `nav_msgs/msg/OccupancyGrid` as a PNG whose upper edge is the highest y.

    Returns:
        Width and height in pixels, how many cells a pixel is wide and high, and the file; None if it is no map.
    """
    width, height = message.info.width, message.info.height
    cells = bytes(memoryview(message.data).cast("B"))
    if not cells or len(cells) != width * height:
        return None
    step = 1
    # A map of a single row stays one.
    while max(1, width // step) * max(1, height // step) > _CELLS:
        step += 1
    pixels = cells.translate(_GREY)
    wide, high = max(1, width // step), max(1, height // step)
    starts = (row * step * width for row in reversed(range(high)))
    # Each row begins with its filter: none.
    rows = b"".join(b"\0" + pixels[start : start + wide * step : step] for start in starts)
    return wide, high, step, _png(wide, high, zlib.compress(rows, 6))


def _png(width: int, height: int, data: bytes) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", data), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    )
