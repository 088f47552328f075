"""Zones as planners draw them: a GeoJSON file of polygons in degrees, as CalTopo, QGIS and TAK write it."""

import json
import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

from sar_compiler.missions import ParameterReader
from sar_compiler.missions.search_and_rescue.areas import AREA_KEYS, pose_inside

if TYPE_CHECKING:
    from pyproj import Geod

AREAS_FILE = "areas_file"
"""The parameter."""
_ORDER = "zone_order"
_GEOREFERENCE = tuple(f"georeference.{name}" for name in ("lat", "lon", "heading"))
_NAMES = ("name", "title")
_MOST_BYTES = 10 * 2**20
_MOST_AREAS = 10_000
# Nobody drives farther from the origin of a map.
_FARTHEST_M = 50_000.0
_MOST_DEGREES = (180.0, 90.0)
# What planners have in the same file: marks, ways, and folders, which have no geometry.
_NO_AREAS = (None, "Point", "MultiPoint", "LineString", "MultiLineString")
# How older writers, such as QGIS, name longitude and latitude on WGS 84, which is all that GeoJSON has today.
_WGS84 = ("CRS84", ":4326")


class _AreasFileError(ValueError):
    """What is wrong with the file, in words."""


def take_areas_file(reader: ParameterReader) -> None:
    """Add the zones of the file that the parameter `areas_file` names to the parameters; what is written there counts before it.

    Each polygon is a zone: `zones.<name>.polygon` in metres, and of its properties those that may stand beside a pose. Marks and lines are
    passed over, which is noted. Where no pose is given it is a point inside. Without a `zone_order` the zones are listed as in the file.
    A path is relative to the file with the parameter.

    Raises:
        ImportError: If there is such a file, and shapely or pyproj is not installed.
        ParameterError: If the file has a mistake, and no other zones are given.
    """
    if AREAS_FILE not in reader.parameters:
        return
    try:
        features = _features(reader)
        areas = {at: each for at, each in enumerate(features, 1) if _kind(each) not in _NO_AREAS}
        zones = dict(_zones(areas, _origin(reader)))
    except _AreasFileError as error:
        if str(error):
            reader.report(AREAS_FILE, str(error))
        if _ORDER not in reader.parameters:
            # That no zones are given is no mistake besides.
            reader.complain()
        return
    if others := len(features) - len(areas):
        reader.notes.append(
            f"{AREAS_FILE}: {others} of {len(features)} features are no polygons and no areas"
        )
    drawn: dict[str, object] = {_ORDER: list(zones)}
    for name, values in zones.items():
        drawn |= {f"zones.{name}.{key}": value for key, value in values.items()}
    reader.parameters = {**drawn, **reader.parameters}


def _features(reader: ParameterReader) -> list[Mapping[str, Any]]:
    text = reader.read_file(AREAS_FILE, "GeoJSON file", _MOST_BYTES)
    if text is None:  # which is reported
        raise _AreasFileError
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise _AreasFileError(f"is no GeoJSON: {error}") from error
    features = data.get("features") if isinstance(data, dict) else None
    if not isinstance(features, list) or not all(isinstance(each, dict) for each in features):
        raise _AreasFileError("is no GeoJSON of polygons: it must be a FeatureCollection with features")
    crs = _inside(_inside(data, "crs"), "properties").get("name", _WGS84[0])
    if not str(crs).endswith(_WGS84):
        raise _AreasFileError(f"is in the coordinates {crs!r:.60}: write it in WGS 84 (EPSG:4326)")
    return features


def _inside(value: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = value.get(key)
    return found if isinstance(found, dict) else {}


def _kind(feature: Mapping[str, Any]) -> Any:
    return _inside(feature, "geometry").get("type")


def _origin(reader: ParameterReader) -> tuple[float, float, float]:
    """Return latitude, longitude and heading of the map."""
    values = [reader.number(key, math.nan if key not in reader.parameters else None) for key in _GEOREFERENCE]
    if any(math.isnan(value) for value in values):
        raise _AreasFileError(
            f"is in degrees: give the place of the map on the earth, {', '.join(_GEOREFERENCE)}"
        )
    return values[0], values[1], values[2]


def _zones(
    features: Mapping[int, Mapping[str, Any]], origin: tuple[float, float, float]
) -> Iterator[tuple[str, dict[str, object]]]:
    """Yield the name of each polygon, with what is a parameter of its zone.

    Raises:
        _AreasFileError: At the first feature that is none of a zone.
    """
    if len(features) > _MOST_AREAS:
        raise _AreasFileError(f"has {len(features):,} areas, and {_MOST_AREAS:,} are the most that are read")
    names = set[str]()
    for number, feature in features.items():
        properties = _inside(feature, "properties")
        name = next((properties[key] for key in _NAMES if properties.get(key)), "")
        where = f"feature {number}" + (f" ({name!r})" if name else "")
        if not isinstance(name, str) or not name or "." in name:
            raise _AreasFileError(f"{where} needs a property `name` without a dot")
        if name in names:
            raise _AreasFileError(f"{where} has the name of another one")
        names.add(name)
        corners = [_placed(corner, origin, where) for corner in _ring(_inside(feature, "geometry"), where)]
        yield name, {**_pose(corners), **_beside(properties)}


def _ring(geometry: Mapping[str, Any], where: str) -> list[Any]:
    kind, rings = geometry.get("type"), geometry.get("coordinates")
    # QGIS writes a layer of polygons so.
    if kind == "MultiPolygon" and isinstance(rings, list) and len(rings) == 1:
        kind, rings = "Polygon", rings[0]
    if kind != "Polygon" or not (isinstance(rings, list) and any(rings) and isinstance(rings[0], list)):
        raise _AreasFileError(f"{where} is no Polygon but {kind}: draw each area as one polygon")
    if len(rings) > 1:
        raise _AreasFileError(
            f"{where} has holes: draw it without; what the map has as an obstacle is left out"
        )
    corners = list(rings[0])
    # The last corner of a ring is the first one again.
    return corners[:-1] if corners[-1] == corners[0] else corners


def _placed(corner: Any, origin: tuple[float, float, float], where: str) -> tuple[float, float]:
    """Return a position of longitude and latitude in the frame `map`, metres."""
    degrees = corner[:2] if isinstance(corner, list) else []
    if not (len(degrees) == len(_MOST_DEGREES) and all(isinstance(each, int | float) for each in degrees)):
        raise _AreasFileError(f"{where} has a corner that is no [longitude, latitude]: {corner!r:.60}")
    if not all(abs(each) <= most for each, most in zip(degrees, _MOST_DEGREES, strict=True)):
        raise _AreasFileError(f"{where} is not in degrees: GeoJSON has longitude and latitude, not metres")
    lat, lon, heading = origin
    bearing, _, far = _ellipsoid().inv(lon, lat, degrees[0], degrees[1])
    if far > _FARTHEST_M:
        km = f"{far / 1000:.0f} km from the origin of the map"
        raise _AreasFileError(
            f"{where} lies {km}: are longitude and latitude in their order, and the georeference right?"
        )
    turn = math.radians(heading - bearing)
    return round(far * math.cos(turn), 3), round(far * math.sin(turn), 3)


@cache
def _ellipsoid() -> "Geod":
    from pyproj import Geod

    return Geod(ellps="WGS84")


def _pose(corners: list[tuple[float, float]]) -> dict[str, object]:
    x, y = pose_inside(corners)
    return {"polygon": [number for corner in corners for number in corner], "x": x, "y": y, "yaw": 0.0}


def _beside(properties: Mapping[str, Any]) -> dict[str, object]:
    """Return what may stand beside a pose; other tools keep much else there."""
    return {key: value for key, value in properties.items() if key in AREA_KEYS and value is not None}
