"""Occupancy maps, read and written like `nav2_map_server` does."""

import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sar_compiler.documents.yaml_files import read_yaml
from sar_compiler.errors import SarError
from sar_compiler.tree.content import read_bytes

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
# The grey values that map_saver writes for the three.
_PIXELS = {UNKNOWN: 205, FREE: 254, OCCUPIED: 0}
_OCCUPIED_THRESH = 0.65
# Below the darkness of 205 (50/255 = 0.19608): with map_saver's own 0.25 map_server reads unknown cells as free.
_FREE_THRESH = 0.196
_MAX_IMAGE_BYTES = 2**30


class MapError(SarError):
    """An occupancy map cannot be read or written."""


@dataclass(frozen=True)
class OccupancyMap:
    """The occupancy of the ground, cell by cell.

    Attributes:
        cells: -1 unknown, 0 free, 100 occupied; shape (height, width), int8, row 0 at the lowest y.
        resolution: Edge of a cell, metres.
        origin_x: The x of the lower left corner of cell (0, 0), metres, frame `map`.
        origin_y: The y of the same corner.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin_x: float
    origin_y: float

    def __post_init__(self) -> None:
        self.cells.setflags(write=False)

    def cell_at(self, x: float, y: float) -> tuple[int, int] | None:
        """Return (row, column) of the cell that contains (x, y) in metres, or None outside the map."""
        row = math.floor((y - self.origin_y) / self.resolution)
        column = math.floor((x - self.origin_x) / self.resolution)
        inside = 0 <= row < self.cells.shape[0] and 0 <= column < self.cells.shape[1]
        return (row, column) if inside else None

    def centre_of(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the centres of cells in metres, shape (n, 2)."""
        x = self.origin_x + (columns + 0.5) * self.resolution
        y = self.origin_y + (rows + 0.5) * self.resolution
        return np.stack((x, y), axis=1)


def read_map(path: Path) -> OccupancyMap:
    """Read a map's description and its image, by `nav2_map_server`'s rules.

    Args:
        path: The `.yaml` file; its `image` is looked up in the same folder.

    Raises:
        UnreadableFileError: If the description or its image does not exist or cannot be read.
        TreeError: If the description has mistakes, or requires unsupported features; carries all findings.
        MapError: If its image is not a valid one.
    """
    document = read_yaml(path, "write what nav2_map_server reads: image, resolution, origin, ...")
    said = document.hold("map").data
    document.raise_findings()
    shade = _shades(path.parent / said["image"])
    dark = shade if said["negate"] else 1.0 - shade
    cells = np.full(shade.shape, UNKNOWN, dtype=np.int8)
    cells[dark < said["free_thresh"]] = FREE
    cells[dark > said["occupied_thresh"]] = OCCUPIED
    upright = np.ascontiguousarray(np.flipud(cells))
    return OccupancyMap(upright, said["resolution"], *said["origin"][:2])


def write_map(occupancy: OccupancyMap, prefix: Path) -> tuple[Path, Path]:
    """Write a map as `nav2_map_server` does.

    Args:
        occupancy: The map to write.
        prefix: The files' path without suffix; `.pgm` and `.yaml` are added.

    Returns:
        The image and the description.

    Raises:
        MapError: If a file cannot be written.
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
    try:
        image.write_bytes(f"P5\n{width} {height}\n255\n".encode() + np.flipud(pixels).tobytes())
        description.write_text(text, encoding="utf-8")
    except OSError as exception:
        message = f"{exception.filename}: cannot be written ({exception.strerror})"
        raise MapError(message) from exception
    return image, description


def _shades(path: Path) -> NDArray[np.float64]:
    """Return the brightness of an image's pixels, 0 black to 1 white, top row first."""
    try:
        with Image.open(io.BytesIO(read_bytes(path, _MAX_IMAGE_BYTES))) as image:
            bands = np.asarray(image.convert("RGBA" if "A" in image.getbands() else "RGB"), dtype=np.float64)
    except (OSError, Image.DecompressionBombError) as exception:
        message = f"{path}: is not an image that can be read ({exception})"
        raise MapError(message) from exception
    shades: NDArray[np.float64] = bands.mean(axis=2) / 255.0
    return shades
