"""Zones as planners draw them: a GeoJSON file of polygons in degrees, as CalTopo, QGIS and TAK write it."""

import math
from collections.abc import Collection, Mapping
from functools import cache, partial
from typing import TYPE_CHECKING, Any

from sar_compiler.missions import ParameterReader
from search_and_rescue.areas import AREA_KEYS, pose_inside

if TYPE_CHECKING:
    from pyproj import Geod

    from sar_compiler.missions import JsonFile

AREAS_FILE = "areas_file"
"""The parameter."""
_ORDER = "zone_order"
_GEOREFERENCE = tuple(f"georeference.{name}" for name in ("lat", "lon", "heading"))
_NAMES = ("name", "title")
_FEATURES = "features"
_JsonPath = tuple[str | int, ...]
_RINGS: _JsonPath = ("geometry", "coordinates")
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
    """What is wrong with the file, in words.

    Attributes:
        path: The keys and indices that lead to the wrong value.
    """

    def __init__(self, text: str, *path: str | int) -> None:
        self.path = path
        super().__init__(text)


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
    before = len(reader.problems)
    file = reader.read_json_file(AREAS_FILE, "GeoJSON file", _MOST_BYTES)
    if file is not None:
        try:
            _add_zones(reader, file)
        except _AreasFileError as error:
            reader.report(AREAS_FILE, str(error), file.place(*error.path))
    if len(reader.problems) > before and _ORDER not in reader.parameters:
        # That no zones are given is no mistake besides.
        reader.complain()


def _add_zones(reader: ParameterReader, file: "JsonFile") -> None:
    """Add the zones of a file to the parameters, and report what is wrong with single ones.

    Raises:
        _AreasFileError: If nothing of the file can be used.
    """
    features = _features(file.data)
    areas = {at: each for at, each in enumerate(features) if _kind(each) not in _NO_AREAS}
    if len(areas) > _MOST_AREAS:
        raise _AreasFileError(
            f"has {len(areas):,} areas, and {_MOST_AREAS:,} are the most that are read", _FEATURES
        )
    origin, zones = _origin(reader), dict[str, tuple[int, dict[str, object]]]()
    if origin is None:
        return
    before = len(reader.problems)

    def add(at: int, feature: Mapping[str, Any]) -> None:
        try:
            name = _name(at, feature, zones)
            zones[name] = at, _zone(feature, origin, f"feature {at + 1} ({name!r})")
        except _AreasFileError as error:
            reader.report(AREAS_FILE, str(error), file.place(_FEATURES, at, *error.path))

    for at, feature in areas.items():
        add(at, feature)
    if len(reader.problems) > before:
        return
    if others := len(features) - len(areas):
        reader.notes.append(
            f"{AREAS_FILE}: {others} of {len(features)} features are no polygons and no areas"
        )
    _draw(reader, file, zones, {name: _inside(areas[at], "properties") for name, (at, _) in zones.items()})


def _draw(
    reader: ParameterReader,
    file: "JsonFile",
    zones: Mapping[str, tuple[int, Mapping[str, object]]],
    properties: Mapping[str, Mapping[str, Any]],
) -> None:
    """Add zones to the parameters, with the places of those that are not written there.

    Args:
        reader: The parameters.
        file: The file.
        zones: The number of the feature of each zone, and the zone's parameters.
        properties: What the file says of each zone beside its outline.
    """
    drawn: dict[str, object] = {_ORDER: list(zones)}
    for name, (at, values) in zones.items():
        for key, value in values.items():
            flat = f"zones.{name}.{key}"
            drawn[flat] = value
            if flat not in reader.parameters:
                inside = ("properties", key) if key in properties[name] else _RINGS
                reader.places_elsewhere[flat] = partial(file.place, _FEATURES, at, *inside)
    reader.parameters = {**drawn, **reader.parameters}


def _features(data: Any) -> list[Mapping[str, Any]]:
    features = data.get(_FEATURES) if isinstance(data, dict) else None
    if not isinstance(features, list) or not all(isinstance(each, dict) for each in features):
        text = "is no GeoJSON of polygons: it must be a FeatureCollection with features"
        raise _AreasFileError(text, _FEATURES)
    crs = _inside(_inside(data, "crs"), "properties").get("name", _WGS84[0])
    if not str(crs).endswith(_WGS84):
        text = f"is in the coordinates {crs!r:.60}: write it in WGS 84 (EPSG:4326)"
        raise _AreasFileError(text, "crs", "properties", "name")
    return features


def _inside(value: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = value.get(key)
    return found if isinstance(found, dict) else {}


def _kind(feature: Mapping[str, Any]) -> Any:
    return _inside(feature, "geometry").get("type")


def _origin(reader: ParameterReader) -> tuple[float, float, float] | None:
    """Return latitude, longitude and heading of the map; None if they are missing, which is reported."""
    values = [reader.number(key, math.nan if key not in reader.parameters else None) for key in _GEOREFERENCE]
    if any(math.isnan(value) for value in values):
        text = f"is in degrees: give the place of the map on the earth, {', '.join(_GEOREFERENCE)}"
        reader.report(AREAS_FILE, text)
        return None
    return values[0], values[1], values[2]


def _name(at: int, feature: Mapping[str, Any], taken: Collection[str]) -> str:
    properties = _inside(feature, "properties")
    key = next((key for key in _NAMES if properties.get(key)), _NAMES[0])
    name = properties.get(key, "")
    where = f"feature {at + 1}" + (f" ({name!r})" if name else "")
    if not isinstance(name, str) or not name or "." in name:
        raise _AreasFileError(f"{where} needs a property `name` without a dot", "properties", key)
    if name in taken:
        raise _AreasFileError(f"{where} has the name of another one", "properties", key)
    return name


def _zone(feature: Mapping[str, Any], origin: tuple[float, float, float], where: str) -> dict[str, object]:
    """Return the parameters of the zone of a polygon.

    Raises:
        _AreasFileError: If the feature is none of a zone; the path in it leads from the feature.
    """
    path, ring = _ring(_inside(feature, "geometry"), where)
    corners = [_placed(corner, origin, where, (*path, at)) for at, corner in enumerate(ring)]
    return {**_pose(corners), **_beside(_inside(feature, "properties"))}


def _ring(geometry: Mapping[str, Any], where: str) -> tuple[_JsonPath, list[Any]]:
    """Return the corners of a polygon, and the path to them from its feature."""
    kind, rings, path = geometry.get("type"), geometry.get("coordinates"), _RINGS
    # QGIS writes a layer of polygons so.
    if kind == "MultiPolygon" and isinstance(rings, list) and len(rings) == 1:
        kind, rings, path = "Polygon", rings[0], (*_RINGS, 0)
    if kind != "Polygon" or not (isinstance(rings, list) and any(rings) and isinstance(rings[0], list)):
        text = f"{where} is no Polygon but {kind}: draw each area as one polygon"
        raise _AreasFileError(text, "geometry", "coordinates" if kind == "Polygon" else "type")
    if len(rings) > 1:
        text = f"{where} has holes: draw it without; what the map has as an obstacle is left out"
        raise _AreasFileError(text, *path, 1)
    corners = list(rings[0])
    # The last corner of a ring is the first one again.
    return (*path, 0), corners[:-1] if corners[-1] == corners[0] else corners


def _placed(
    corner: Any, origin: tuple[float, float, float], where: str, path: _JsonPath
) -> tuple[float, float]:
    """Return a position of longitude and latitude in the frame `map`, metres."""
    degrees = corner[:2] if isinstance(corner, list) else []
    if not (len(degrees) == len(_MOST_DEGREES) and all(type(each) in (int, float) for each in degrees)):
        raise _AreasFileError(f"{where} has a corner that is no [longitude, latitude]: {corner!r:.60}", *path)
    if not all(abs(each) <= most for each, most in zip(degrees, _MOST_DEGREES, strict=True)):
        raise _AreasFileError(
            f"{where} is not in degrees: GeoJSON has longitude and latitude, not metres", *path
        )
    lat, lon, heading = origin
    bearing, _, far = _ellipsoid().inv(lon, lat, degrees[0], degrees[1])
    if far > _FARTHEST_M:
        text = f"lies {far / 1000:.0f} km from the origin of the map"
        asked = "are longitude and latitude in their order, and the georeference right?"
        raise _AreasFileError(f"{where} {text}: {asked}", *path)
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
