"""Zones from planning tools: a GeoJSON file of polygons in degrees, as written by CalTopo, QGIS and TAK."""

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
# Farthest distance of a zone from the origin of a map.
_FARTHEST_M = 50_000.0
_MOST_DEGREES = (180.0, 90.0)
# Other objects that planning tools write to the same file: markers, paths, and folders, which have no geometry.
_NO_AREAS = (None, "Point", "MultiPoint", "LineString", "MultiLineString")
# Names of longitude and latitude on WGS 84 in older files, such as those of QGIS; GeoJSON today allows nothing else.
_WGS84 = ("CRS84", ":4326")


class _AreasFileError(ValueError):
    """An error in the file.

    Attributes:
        path: Keys and indices of the wrong value.
    """

    def __init__(self, text: str, *path: str | int) -> None:
        self.path = path
        super().__init__(text)


def read_areas_file(reader: ParameterReader) -> None:
    """Add the zones of the parameter `areas_file` to the parameters; existing parameters take precedence.

    Each polygon becomes a zone: `zones.<name>.polygon` in metres, and those of its properties that a zone can have. Markers and lines are
    skipped with a note. A missing pose is replaced by a point inside. Without a `zone_order` the zones have the order of the file.
    A relative path starts from the folder of the parameter file.

    Raises:
        ImportError: If there is such a file, and shapely or pyproj is not installed.
        ParameterError: If the file has errors, and no other zones are given.
    """
    if AREAS_FILE not in reader.parameters:
        return
    before = len(reader.problems)
    file = reader.read_json_file(AREAS_FILE, "GeoJSON file", _MOST_BYTES)
    if file is not None:
        try:
            _add_zones(reader, file)
        except _AreasFileError as error:
            reader.report_error(AREAS_FILE, str(error), file.location_of(*error.path))
    if len(reader.problems) > before and _ORDER not in reader.parameters:
        # Missing zones are not a second error then.
        reader.complain()


def _add_zones(reader: ParameterReader, file: "JsonFile") -> None:
    """Add the zones of a file to the parameters, and report errors in single zones.

    Raises:
        _AreasFileError: If the whole file is unusable.
    """
    features = _features(file.data)
    areas = {at: each for at, each in enumerate(features) if _kind(each) not in _NO_AREAS}
    if len(areas) > _MOST_AREAS:
        raise _AreasFileError(f"has {len(areas):,} areas: keep at most {_MOST_AREAS:,}", _FEATURES)
    origin, zones = _origin(reader), dict[str, tuple[int, dict[str, object]]]()
    if origin is None:
        return
    before = len(reader.problems)

    def add(at: int, feature: Mapping[str, Any]) -> None:
        try:
            name = _name(at, feature, zones)
            zones[name] = at, _zone(feature, origin, f"feature {at + 1} ({name!r})")
        except _AreasFileError as error:
            reader.report_error(AREAS_FILE, str(error), file.location_of(_FEATURES, at, *error.path))

    for at, feature in areas.items():
        add(at, feature)
    if len(reader.problems) > before:
        return
    if others := len(features) - len(areas):
        reader.notes.append(
            f"{AREAS_FILE}: skipped {others} of {len(features)} features, which are not polygons"
        )
    _draw(reader, file, zones, {name: _inside(areas[at], "properties") for name, (at, _) in zones.items()})


def _draw(
    reader: ParameterReader,
    file: "JsonFile",
    zones: Mapping[str, tuple[int, Mapping[str, object]]],
    properties: Mapping[str, Mapping[str, Any]],
) -> None:
    """Add zones to the parameters, with the locations of their keys.

    Args:
        reader: The parameters.
        file: The file.
        zones: The index of the feature of each zone, and the zone's parameters.
        properties: The zone's further parameters from the file.
    """
    drawn: dict[str, object] = {_ORDER: list(zones)}
    for name, (at, values) in zones.items():
        for key, value in values.items():
            flat = f"zones.{name}.{key}"
            drawn[flat] = value
            if flat not in reader.parameters:
                inside = ("properties", key) if key in properties[name] else _RINGS
                reader.places_elsewhere[flat] = partial(file.location_of, _FEATURES, at, *inside)
    reader.parameters = {**drawn, **reader.parameters}


def _features(data: Any) -> list[Mapping[str, Any]]:
    features = data.get(_FEATURES) if isinstance(data, dict) else None
    if not isinstance(features, list) or not all(isinstance(each, dict) for each in features):
        text = "contains no GeoJSON polygons: write a FeatureCollection with features"
        raise _AreasFileError(text, _FEATURES)
    crs = _inside(_inside(data, "crs"), "properties").get("name", _WGS84[0])
    if not str(crs).endswith(_WGS84):
        text = f"uses the coordinates {crs!r:.60}: write WGS 84 (EPSG:4326)"
        raise _AreasFileError(text, "crs", "properties", "name")
    return features


def _inside(value: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = value.get(key)
    return found if isinstance(found, dict) else {}


def _kind(feature: Mapping[str, Any]) -> Any:
    return _inside(feature, "geometry").get("type")


def _origin(reader: ParameterReader) -> tuple[float, float, float] | None:
    """Return latitude, longitude and heading of the map; report them and return None if they are missing."""
    values = [reader.number(key, math.nan if key not in reader.parameters else None) for key in _GEOREFERENCE]
    if any(math.isnan(value) for value in values):
        text = f"is in degrees: add the map's georeference, {', '.join(_GEOREFERENCE)}"
        reader.report_error(AREAS_FILE, text)
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
        raise _AreasFileError(f"{where} repeats the name of another feature", "properties", key)
    return name


def _zone(feature: Mapping[str, Any], origin: tuple[float, float, float], where: str) -> dict[str, object]:
    """Return the parameters of a polygon's zone.

    Raises:
        _AreasFileError: If the feature is not a valid zone; its path starts at the feature.
    """
    path, ring = _ring(_inside(feature, "geometry"), where)
    corners = [_to_map_position(corner, origin, where, (*path, at)) for at, corner in enumerate(ring)]
    return {**_pose(corners), **_extra_parameters(_inside(feature, "properties"))}


def _ring(geometry: Mapping[str, Any], where: str) -> tuple[_JsonPath, list[Any]]:
    """Return the corners of a polygon, and their path within the feature."""
    kind, rings, path = geometry.get("type"), geometry.get("coordinates"), _RINGS
    # QGIS writes a layer of polygons this way.
    if kind == "MultiPolygon" and isinstance(rings, list) and len(rings) == 1:
        kind, rings, path = "Polygon", rings[0], (*_RINGS, 0)
    if kind != "Polygon" or not (isinstance(rings, list) and any(rings) and isinstance(rings[0], list)):
        what = "Polygon without corners" if kind == "Polygon" else kind
        text = f"{where} is a {what}: draw each area as one polygon"
        raise _AreasFileError(text, "geometry", "coordinates" if kind == "Polygon" else "type")
    if len(rings) > 1:
        text = f"{where} has holes: draw it without them; obstacles on the map are excluded anyway"
        raise _AreasFileError(text, *path, 1)
    corners = list(rings[0])
    # The last corner of a ring is the first one again.
    return (*path, 0), corners[:-1] if corners[-1] == corners[0] else corners


def _to_map_position(
    corner: Any, origin: tuple[float, float, float], where: str, path: _JsonPath
) -> tuple[float, float]:
    """Return a longitude and latitude as a position in the frame `map`, metres."""
    degrees = corner[:2] if isinstance(corner, list) else []
    if not (len(degrees) == len(_MOST_DEGREES) and all(type(each) in (int, float) for each in degrees)):
        raise _AreasFileError(
            f"{where} has a corner that is not [longitude, latitude]: {corner!r:.60}", *path
        )
    if not all(abs(each) <= most for each, most in zip(degrees, _MOST_DEGREES, strict=True)):
        raise _AreasFileError(
            f"{where} is not in degrees: write longitude and latitude instead of metres", *path
        )
    lat, lon, heading = origin
    bearing, _, far = _ellipsoid().inv(lon, lat, degrees[0], degrees[1])
    if far > _FARTHEST_M:
        text = f"is {far / 1000:.0f} km from the origin of the map"
        asked = "check the order of longitude and latitude, and the georeference"
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


def _extra_parameters(properties: Mapping[str, Any]) -> dict[str, object]:
    """Return the zone's further parameters; properties of other tools are ignored."""
    return {key: value for key, value in properties.items() if key in AREA_KEYS and value is not None}
