"""Read zones from a GeoJSON file that a planning tool such as CalTopo, QGIS or TAK has exported."""

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
"""The parameter with the path of the GeoJSON file."""
_ORDER = "zone_order"
_GEOREFERENCE = tuple(f"georeference.{name}" for name in ("lat", "lon", "heading"))
_NAMES = ("name", "title")
_FEATURES = "features"
_JsonPath = tuple[str | int, ...]
_RINGS: _JsonPath = ("geometry", "coordinates")
_MAX_BYTES = 10 * 2**20
_MAX_AREAS = 10_000
# Maximum distance of a zone's corner from the map's origin.
_MAX_DISTANCE_M = 50_000.0
_MAX_DEGREES = (180.0, 90.0)
# Geometry types of features that are skipped: markers, lines, and folders (which have no geometry).
_SKIPPED_TYPES = (None, "Point", "MultiPoint", "LineString", "MultiLineString")
# Endings of the coordinate systems that mean longitude and latitude on WGS 84. RFC 7946 allows only WGS 84; QGIS still writes `crs`.
_WGS84 = ("CRS84", ":4326")


class _AreasFileError(ValueError):
    """An error in the GeoJSON file.

    Attributes:
        path: The JSON keys and indices that lead to the wrong value.
    """

    def __init__(self, text: str, *path: str | int) -> None:
        self.path = path
        super().__init__(text)


def read_areas_file(reader: ParameterReader) -> None:
    """Add the zones in the file `areas_file` to the parameters. Existing parameters take precedence.

    Each polygon becomes the parameter `zones.<name>.polygon`, in metres. Properties of the polygon that are zone parameters are added as well.
    Other geometries are skipped with a note. A zone without a pose gets the pose of a point inside the polygon. Without the parameter
    `zone_order`, the zones have the order of the file. A relative path is relative to the folder of the parameter file.

    Raises:
        ImportError: If the parameter `areas_file` is given, and shapely or pyproj is not installed.
        ParameterError: If the file has errors and the parameter `zone_order` is missing.
    """
    if AREAS_FILE not in reader.parameters:
        return
    before = len(reader.problems)
    file = reader.read_json_file(AREAS_FILE, "GeoJSON file", _MAX_BYTES)
    if file is not None:
        try:
            _add_zones(reader, file)
        except _AreasFileError as error:
            reader.report_error(AREAS_FILE, str(error), file.location_of(*error.path))
    if len(reader.problems) > before and _ORDER not in reader.parameters:
        # The error is raised now. Otherwise the missing zones would be reported as a second error.
        reader.complain()


def _add_zones(reader: ParameterReader, file: "JsonFile") -> None:
    """Add the zones in a GeoJSON file to the parameters. If any feature is wrong, report all errors and add no zone.

    Raises:
        _AreasFileError: If the file is not a FeatureCollection in WGS 84, or has too many areas.
    """
    features = _features(file.data)
    areas = {at: each for at, each in enumerate(features) if _geometry_type(each) not in _SKIPPED_TYPES}
    if len(areas) > _MAX_AREAS:
        raise _AreasFileError(f"has {len(areas):,} areas: write at most {_MAX_AREAS:,}", _FEATURES)
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
    properties = {name: _object_at(areas[at], "properties") for name, (at, _) in zones.items()}
    _add_parameters(reader, file, zones, properties)


def _add_parameters(
    reader: ParameterReader,
    file: "JsonFile",
    zones: Mapping[str, tuple[int, Mapping[str, object]]],
    properties: Mapping[str, Mapping[str, Any]],
) -> None:
    """Add zones to the parameters, with the location of each parameter in the GeoJSON file.

    Args:
        reader: Reader of the mission parameters, to which the zones are added.
        file: The GeoJSON file.
        zones: By zone name, the index of the zone's feature, and the zone's parameters.
        properties: By zone name, the properties of the zone's feature.
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
        text = "is not a GeoJSON FeatureCollection: export polygons as a FeatureCollection"
        raise _AreasFileError(text, _FEATURES)
    crs = _object_at(_object_at(data, "crs"), "properties").get("name", _WGS84[0])
    if not str(crs).endswith(_WGS84):
        text = f"uses the coordinate system {crs!r:.60}: export the file in WGS 84 (EPSG:4326)"
        raise _AreasFileError(text, "crs", "properties", "name")
    return features


def _object_at(value: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = value.get(key)
    return found if isinstance(found, dict) else {}


def _geometry_type(feature: Mapping[str, Any]) -> Any:
    return _object_at(feature, "geometry").get("type")


def _origin(reader: ParameterReader) -> tuple[float, float, float] | None:
    """Return latitude, longitude and heading of the map's origin. If one is missing, report it and return None."""
    values = [reader.number(key, math.nan if key not in reader.parameters else None) for key in _GEOREFERENCE]
    if any(math.isnan(value) for value in values):
        text = f"contains degrees, which need the georeference of the map: add {', '.join(_GEOREFERENCE)}"
        reader.report_error(AREAS_FILE, text)
        return None
    return values[0], values[1], values[2]


def _name(at: int, feature: Mapping[str, Any], taken: Collection[str]) -> str:
    properties = _object_at(feature, "properties")
    key = next((key for key in _NAMES if properties.get(key)), _NAMES[0])
    name = properties.get(key, "")
    where = f"feature {at + 1}" + (f" ({name!r})" if name else "")
    if not isinstance(name, str) or not name or "." in name:
        raise _AreasFileError(f"{where} needs a property `name` without a dot", "properties", key)
    if name in taken:
        raise _AreasFileError(f"{where} has the same name as another feature", "properties", key)
    return name


def _zone(feature: Mapping[str, Any], origin: tuple[float, float, float], where: str) -> dict[str, object]:
    """Convert a polygon feature to the parameters of a zone.

    Raises:
        _AreasFileError: If the feature is not a valid zone; the path of the error is relative to the feature.
    """
    path, ring = _ring(_object_at(feature, "geometry"), where)
    corners = [_to_map_position(corner, origin, where, (*path, at)) for at, corner in enumerate(ring)]
    return {**_pose(corners), **_extra_parameters(_object_at(feature, "properties"))}


def _ring(geometry: Mapping[str, Any], where: str) -> tuple[_JsonPath, list[Any]]:
    """Return the JSON path and the corners of the outer ring of a polygon feature."""
    kind, rings, path = geometry.get("type"), geometry.get("coordinates"), _RINGS
    # QGIS can export a polygon as a MultiPolygon with a single polygon.
    if kind == "MultiPolygon" and isinstance(rings, list) and len(rings) == 1:
        kind, rings, path = "Polygon", rings[0], (*_RINGS, 0)
    if kind != "Polygon" or not (isinstance(rings, list) and any(rings) and isinstance(rings[0], list)):
        what = "Polygon without corners" if kind == "Polygon" else kind
        text = f"{where} is a {what}: draw each area as a separate polygon"
        raise _AreasFileError(text, "geometry", "coordinates" if kind == "Polygon" else "type")
    if len(rings) > 1:
        text = f"{where} has holes. Draw it without holes: obstacles on the map are excluded automatically"
        raise _AreasFileError(text, *path, 1)
    corners = list(rings[0])
    # The last corner of a GeoJSON ring repeats the first corner.
    return (*path, 0), corners[:-1] if corners[-1] == corners[0] else corners


def _to_map_position(
    corner: Any, origin: tuple[float, float, float], where: str, path: _JsonPath
) -> tuple[float, float]:
    """Convert a corner (longitude and latitude, degrees) to a position in the frame `map` (metres)."""
    degrees = corner[:2] if isinstance(corner, list) else []
    if not (len(degrees) == len(_MAX_DEGREES) and all(type(each) in (int, float) for each in degrees)):
        raise _AreasFileError(
            f"{where} has the corner {corner!r:.60}: write [longitude, latitude] in degrees", *path
        )
    if not all(abs(each) <= most for each, most in zip(degrees, _MAX_DEGREES, strict=True)):
        raise _AreasFileError(
            f"{where} has corners that are not in degrees: write [longitude, latitude] instead of metres",
            *path,
        )
    lat, lon, heading = origin
    bearing, _, far = _ellipsoid().inv(lon, lat, degrees[0], degrees[1])
    if far > _MAX_DISTANCE_M:
        text = f"has a corner {far / 1000:.0f} km from the origin of the map"
        remedy = "check the order of longitude and latitude, and the georeference"
        raise _AreasFileError(f"{where} {text}: {remedy}", *path)
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
    """Return the properties that are zone parameters and are not null."""
    return {key: value for key, value in properties.items() if key in AREA_KEYS and value is not None}
