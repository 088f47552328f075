"""Occupancy maps, and their files in the format of `nav2_map_server`."""

import io
import math
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sar_compiler.checks.configuration import path_inside
from sar_compiler.documents.yaml_files import read_yaml
from sar_compiler.errors import SarError
from sar_compiler.opener import IMAGE, MAP, read_file

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
# The grey values that map_saver writes for the three states.
_PIXELS = {UNKNOWN: 205, FREE: 254, OCCUPIED: 0}
_OCCUPIED_THRESH = 0.65
# Slightly below the darkness of grey value 205 (50/255 = 0.19608). With map_saver's 0.25, map_server reads unknown cells as free.
_FREE_THRESH = 0.196
# The number of cells that the planner can process with about a gigabyte of memory: 70 m x 70 m with cells of 5 cm.
_MAX_CELLS = 2_000_000
# The image formats that map_saver and drawing programs write. Other decoders of Pillow start programs, or are less tested.
_FORMATS = ("BMP", "JPEG", "PNG", "PPM")


class _ImageError(SarError):
    """An image cannot be read."""


@dataclass(frozen=True)
class OccupancyMap:
    """A map whose cells are free, occupied or unknown.

    Attributes:
        cells: The state of each cell: -1 unknown, 0 free, 100 occupied; shape (height, width), int8, row 0 at the lowest y.
        resolution: The edge length of a cell, metres.
        origin_x: The x of the lower left corner of cell (0, 0), metres, frame `map`.
        origin_y: The y of the same corner, metres, frame `map`.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin_x: float
    origin_y: float

    def __post_init__(self) -> None:
        self.cells.setflags(write=False)

    def cell_at(self, x: float, y: float) -> tuple[int, int] | None:
        """Return (row, column) of the cell that contains a position (m, frame `map`); None outside the map."""
        row = math.floor((y - self.origin_y) / self.resolution)
        column = math.floor((x - self.origin_x) / self.resolution)
        inside = 0 <= row < self.cells.shape[0] and 0 <= column < self.cells.shape[1]
        return (row, column) if inside else None

    def centre_of(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the centres of cells in metres, frame `map`, shape (n, 2)."""
        x = self.origin_x + (columns + 0.5) * self.resolution
        y = self.origin_y + (rows + 0.5) * self.resolution
        return np.stack((x, y), axis=1)


def read_map(path: Path) -> OccupancyMap:
    """Read the description and the image of a map in the format of `nav2_map_server`.

    Args:
        path: The `.yaml` file; its `image` is looked up in the same folder.

    Raises:
        UnreadableFileError: If the description or its image does not exist or cannot be read.
        TreeError: If the description has errors or requires unsupported features, or if the image is invalid, damaged, too
                large, or outside the repository; the error contains all findings.
    """
    document = read_yaml(path, MAP, "write the keys of nav2_map_server: image, resolution, origin, ...")
    values = document.validate("map").data
    named = document.root.mapping.get("image")
    image = path_inside(document, path.parent, named, "image") if named and "image" in values else None
    document.raise_findings()
    assert named is not None and image is not None  # noqa: S101, PT018 - otherwise there are findings
    try:
        sums, white = _brightness(image)
    except _ImageError as error:
        document.report("wrong-value", f"{image}: {error}", named)
        document.raise_findings()
    # The state of a cell is looked up by the brightness of its pixel, so that even a large image needs little memory.
    shade = np.arange(white + 1) / white
    dark = shade if values["negate"] else 1.0 - shade
    cell_of = np.full(white + 1, UNKNOWN, dtype=np.int8)
    cell_of[dark < values["free_thresh"]] = FREE
    cell_of[dark > values["occupied_thresh"]] = OCCUPIED
    upright = np.ascontiguousarray(np.flipud(cell_of[sums]))
    return OccupancyMap(upright, values["resolution"], *values["origin"][:2])


def map_files(occupancy: OccupancyMap, prefix: Path) -> dict[Path, bytes]:
    """Return the contents of a map's files by path: image and description in the format of `nav2_map_server`.

    Args:
        occupancy: The map.
        prefix: The path of the files without suffix, to which `.pgm` and `.yaml` are appended.
    """
    image, description = prefix.with_name(f"{prefix.name}.pgm"), prefix.with_name(f"{prefix.name}.yaml")
    pixels: NDArray[np.uint8] = np.full(occupancy.cells.shape, _PIXELS[UNKNOWN], dtype=np.uint8)
    for value in (FREE, OCCUPIED):
        pixels[occupancy.cells == value] = _PIXELS[value]
    height, width = pixels.shape
    text = (
        f"image: {image.name}\nmode: trinary\nresolution: {occupancy.resolution:g}\n"
        f"origin: [{occupancy.origin_x:.6g}, {occupancy.origin_y:.6g}, 0]\nnegate: 0\n"
        f"occupied_thresh: {_OCCUPIED_THRESH}\nfree_thresh: {_FREE_THRESH}\n"
    )
    return {
        image: f"P5\n{width} {height}\n255\n".encode() + np.flipud(pixels).tobytes(),
        description: text.encode(),
    }


def _brightness(path: Path) -> tuple[NDArray[np.uint16], int]:
    """Return the sum of each pixel's colour bands, top row first, and the sum for a white pixel.

    Raises:
        UnreadableFileError: If the file does not exist or cannot be read.
        _ImageError: If the file is not an image in one of `_FORMATS`, is damaged, or is too large.
    """
    data = read_file(path, IMAGE).data
    if len(data) > IMAGE.limit:
        raise _ImageError(f"the image is larger than {IMAGE.limit // 2**20} MiB")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # the size is checked below
            # Pillow knows the size before it decodes the image.
            with Image.open(io.BytesIO(data), formats=_FORMATS) as image:
                _require_size(*image.size)
                bands = np.asarray(image.convert("RGBA" if "A" in image.getbands() else "RGB"))
    except (_ImageError, MemoryError):
        raise
    except Exception as error:
        # The decoder of damaged data may raise any exception: ValueError, SyntaxError, struct.error, ...
        raise _ImageError(f"the file is not a readable image ({error})") from error
    return bands.sum(axis=2, dtype=np.uint16), 255 * bands.shape[2]


def _require_size(width: int, height: int) -> None:
    if not 0 < width * height <= _MAX_CELLS:
        message = (
            f"the image has {width} x {height} pixels. Reduce the image to at most {_MAX_CELLS:,} pixels"
        )
        raise _ImageError(message)
