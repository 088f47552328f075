"""Read all parameters of zones except poses: probabilities, priorities, polygons and sensor ranges."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from sar_compiler.missions import ParameterReader
from search_and_rescue.search_theory import (
    COVERAGE,
    ROUNDING,
    SWEEP_FACTORS,
    Corners,
    Ground,
    SearchExpectation,
    sweep_width_of,
)
from search_and_rescue.sweeps import MAX_PIECES
from search_and_rescue.zone_manager import Geofence

_PROBABILITIES = ("poa", "pod", "look_sec")
_SENSOR = ("sweep_width", "detection_range", "visibility")
_POLYGON = "polygon"
AREA_KEYS = (*_PROBABILITIES, _POLYGON, *_SENSOR, "priority")
"""The parameters that a zone can have in addition to a pose."""
MIN_CORNERS = 3
"""The minimum number of corners of a polygon."""
MAX_RANGE_M = 1_000.0
"""The maximum detection range and sweep width, metres. They are limited because every map cell within the range is examined."""
# A polygon that extends beyond the geofence by at most this distance is inside.
_TOLERANCE_M = 1e-6
# Corners within this distance of the georeference (latitude and longitude) are probably in degrees.
_NEAR_DEG = 0.5


def read_areas(
    reader: ParameterReader, zones: Sequence[Mapping[str, Any]], sweeps_sec: Mapping[str, float] | None = None
) -> dict[str, SearchExpectation]:
    """Read the probabilities and search durations of zones from the parameters `zones.<id>.{poa,pod,look_sec}`.

    If any zone has one of these parameters, every zone needs `poa` and `pod`. If no zone has any, return an empty dictionary.

    Args:
        reader: Reader of the mission parameters.
        zones: The zones.
        sweeps_sec: Default duration of a search in seconds, by zone ID; 0 for zones that are not listed.
    """
    keys = [f"zones.{zone['id']}.{name}" for zone in zones for name in _PROBABILITIES]
    if not any(key in reader.parameters for key in keys):
        return {}
    areas, mistakes = dict[str, SearchExpectation](), len(reader.problems)
    for zone in zones:
        prefix = f"zones.{zone['id']}"
        poa, pod = (reader.number(f"{prefix}.{name}") for name in ("poa", "pod"))
        look_sec = reader.number(f"{prefix}.look_sec", (sweeps_sec or {}).get(zone["id"], 0.0))
        areas[zone["id"]] = SearchExpectation(poa, pod, look_sec)
    total = math.fsum(area.poa for area in areas.values())
    if len(reader.problems) == mistakes and total > 1.0 + ROUNDING:
        text = f"the poa values of all zones add up to {total:g}: the sum must be at most 1, and below 1 if the person may be outside all zones"
        reader.report_error(f"zones.{zones[0]['id']}.poa", text)
    return areas


def read_priorities(reader: ParameterReader, zones: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Read the parameters `zones.<id>.priority` (default 0). `ChooseZone` prefers zones with a higher priority."""
    return {zone["id"]: reader.number(f"zones.{zone['id']}.priority", 0.0) for zone in zones}


def read_grounds(
    reader: ParameterReader, zones: Sequence[Mapping[str, Any]], fence: Geofence
) -> dict[str, Ground]:
    """Read the grounds of zones with polygons: `zones.<id>.{polygon,sweep_width,detection_range,visibility}`.

    Raises:
        ImportError: If a zone has a polygon, and shapely is not installed.
    """
    grounds = {zone["id"]: _ground(reader, f"zones.{zone['id']}", fence) for zone in zones}
    return {zone: ground for zone, ground in grounds.items() if ground is not None}


def add_plausibility_notes(
    reader: ParameterReader, zones: Sequence[Mapping[str, Any]], grounds: Mapping[str, Ground]
) -> None:
    """Add a note for each probable typo, such as a pose outside the polygon, or too many stops for a sweep.

    Raises:
        ImportError: If `grounds` is not empty, and shapely is not installed.
    """
    for zone in zones:
        if (ground := grounds.get(zone["id"])) is None:
            continue
        import shapely

        outline, key = shapely.Polygon(ground.polygon), f"zones.{zone['id']}"
        away = outline.distance(shapely.Point(zone["x"], zone["y"]))
        if away > ground.detection_range:
            pose = f"({zone['x']:g}, {zone['y']:g})"
            reader.notes.append(f"the pose {pose} of {key} is {away:.1f} m outside the {_POLYGON} of {key}")
        if ground.area_m2 > MAX_PIECES * (ground.sweep_width / COVERAGE) ** 2:
            stops = f"more than {MAX_PIECES} stops (the maximum of a sweep) at coverage {COVERAGE:g}"
            reader.notes.append(f"{key} needs {stops}: divide the zone, or check {_SENSOR[0]}")


def _ground(reader: ParameterReader, prefix: str, fence: Geofence) -> Ground | None:
    if f"{prefix}.{_POLYGON}" in reader.parameters:
        polygon = _polygon(reader, f"{prefix}.{_POLYGON}", fence)
        return Ground(polygon, *_sensor(reader, prefix))
    for name in _SENSOR:
        if f"{prefix}.{name}" in reader.parameters:
            reader.report_error(
                f"{prefix}.{name}", f"has no effect without a polygon: add {prefix}.{_POLYGON}"
            )
    return None


def _sensor(reader: ParameterReader, prefix: str) -> tuple[float, float]:
    """Return sweep width and detection range, metres. If one is missing, compute it from the other one."""
    width_key, range_key, visibility_key = (f"{prefix}.{name}" for name in _SENSOR)
    visibility = reader.parameters.get(visibility_key, "medium")
    if visibility not in SWEEP_FACTORS:
        reader.report_error(
            visibility_key, f"must be one of {', '.join(SWEEP_FACTORS)}, but is {visibility!r}"
        )
        visibility = "medium"
    if width_key not in reader.parameters and range_key not in reader.parameters:
        text = f"is missing: add {range_key} (the maximum distance at which a survivor can be detected) or {width_key}, in metres"
        reader.report_error(width_key, text)
        return 1.0, 1.0
    per_range = sweep_width_of(1.0, str(visibility))
    mistakes = len(reader.problems)
    width = reader.positive(width_key, reader.number(range_key, 0.0) * per_range, MAX_RANGE_M)
    reach = reader.positive(range_key, width / per_range, MAX_RANGE_M)
    if len(reader.problems) == mistakes and width > 2 * reach:
        text = f"is {width:g} m, more than twice {range_key}: write at most {2 * reach:g}"
        reader.report_error(width_key, text)
    return width, reach


def _polygon(reader: ParameterReader, key: str, fence: Geofence) -> Corners:
    """Return the corners in a polygon parameter. If it has errors, report them and return no corners."""
    mistakes = len(reader.problems)
    numbers = reader.numbers(key)
    if len(reader.problems) > mistakes:
        return ()
    corners = tuple(zip(numbers[::2], numbers[1::2], strict=False))
    if len(numbers) % 2 or len(corners) < MIN_CORNERS:
        text = f"must contain x and y of three or more corners, [x1, y1, x2, y2, x3, y3], but contains {len(numbers)} numbers"
        reader.report_error(key, text)
    elif _are_degrees(reader.parameters, corners):
        text = "looks like degrees: write metres in the frame `map`, or give a GeoJSON file as areas_file"
        reader.report_error(key, text)
    elif objection := outline_objection(corners, fence):
        reader.report_error(key, objection)
    return corners if len(reader.problems) == mistakes else ()


def outline_objection(corners: Corners, fence: Geofence) -> str:
    """Return the error in a polygon, such as "has no area", or an empty string if the polygon is valid.

    The polygon has at least three corners, in metres in the frame `map`.

    Raises:
        ImportError: If shapely is not installed.
    """
    import shapely

    outline = shapely.Polygon(corners)
    if not outline.convex_hull.area:
        return "has no area: all corners are on one line"
    if not outline.is_valid:
        # Shapely returns a text such as "Self-intersection[1 2]".
        x, y = shapely.is_valid_reason(outline).partition("[")[2].rstrip("]").split()
        return f"crosses or touches itself at ({float(x):.2f}, {float(y):.2f})"
    outside = [corner for corner in corners if not fence.contains(*corner)]
    if outside:
        return f"has the corner ({outside[0][0]:g}, {outside[0][1]:g}) outside the geofence"
    # An edge can leave the geofence although both ends of the edge are inside.
    edge = shapely.LinearRing(fence.corners).intersection(outline.buffer(-_TOLERANCE_M))
    if edge.is_empty:
        return ""
    point = edge.representative_point()
    return f"leaves the geofence between two corners, at ({point.x:.2f}, {point.y:.2f})"


def pose_inside(corners: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return a point inside a polygon. Point and polygon are in metres, in the frame `map`.

    Raises:
        ImportError: If shapely is not installed.
    """
    import shapely

    shape = shapely.Polygon(corners) if len(corners) >= MIN_CORNERS else shapely.MultiPoint(corners)
    inside = shape.representative_point()
    return round(inside.x, 3), round(inside.y, 3)


def _are_degrees(parameters: Mapping[str, object], corners: Corners) -> bool:
    """Return whether the corners are probably in degrees, because they are near the origin's coordinates."""
    origin_degrees = [parameters.get(f"georeference.{name}") for name in ("lat", "lon")]
    if not all(isinstance(value, int | float) for value in origin_degrees):
        return False
    lat, lon = (float(str(value)) for value in origin_degrees)
    return any(
        all(math.dist(corner, origin) < _NEAR_DEG for corner in corners)
        for origin in ((lat, lon), (lon, lat))
    )
