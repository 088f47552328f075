"""The map of a report: what was searched, who was found, and the way of the robot, as SVG."""

import itertools
import math
import re
from collections.abc import Iterable, Iterator
from html import escape

from sar_compiler.journal.mission_state import MissionState, Position, RobotPose, ZoneState
from sar_compiler.tree.showing import visible

# A picture that is not as a journal has it is left out.
_BASE64 = re.compile(r"[A-Za-z0-9+/]+=*", re.ASCII)
# Symbols are this part of the longer edge.
_SYMBOL = 1 / 90
_MARGIN = 1 / 20
# A label takes so many symbols' room.
_LABEL = 20
# How far below a place a label stands, in symbols: a survivor's name does not hide the zone's, nor what is said of that.
_BELOW = {"": 0.8, "name": -0.6, "said": 2.5}
# A break of so many metres in the path is no way of a robot: it was carried, or the localisation has jumped.
_JUMP_M = 5.0
# A map that is turned by less is drawn as if it were not.
_TURNED_RAD = 1e-3


_ZONE = '<circle class="zone {}" r="1.2"/>'
_DIAMOND = '<polygon class="survivor {}" points="0,-1.6 1.6,0 0,1.6 -1.6,0"/>'
LEGEND = (
    (_DIAMOND.format("confirmed"), "survivor, confirmed by the operator"),
    (_DIAMOND.format("candidate"), "survivor, not yet judged"),
    (_DIAMOND.format("rejected"), "survivor, rejected by the operator"),
    (_DIAMOND.format("merged"), "survivor, merged with another"),
    (_ZONE.format("searched"), "zone searched"),
    (_ZONE.format("visited"), "zone visited, not searched"),
    (_ZONE.format("open"), "zone not searched"),
    (_ZONE.format("abandoned"), "zone not searched, given up"),
    ('<rect class="base" x="-1" y="-1" width="2" height="2"/>', "base station"),
    ('<polyline class="path" points="-2,0 2,0"/>', "way of the robot"),
    ('<polyline class="fence" points="-2,0 2,0"/>', "geofence"),
)
"""What may be on the map: each as SVG around the origin, drawn like the map in units of a symbol, and in words."""
_CLASS = re.compile(r'class="[^"]+"')


def legend_of(drawing: str) -> Iterable[tuple[str, str]]:
    """Return the rows of the legend for what is on a map."""
    drawn = set(_CLASS.findall(drawing))
    return (row for row in LEGEND if drawn.intersection(_CLASS.findall(row[0])))


def report_map(state: MissionState) -> str:
    """Return the map as an SVG element; empty if no position is known."""
    extent = _extent(state)
    if extent is None:
        return ""
    left, low, right, high = extent
    size = max(right - left, high - low) * _SYMBOL
    parts = [
        *_image(state),
        *_grid(extent, size),
        *_fence(state),
        *_path(state),
        *_places(state, right, size),
    ]
    box = f"{left:.3f} {-high:.3f} {right - left:.3f} {high - low:.3f}"
    label = "Map: the way of the robot, zones, survivors and the base station"
    return (
        f'<svg class="map" viewBox="{box}" role="img" aria-label="{label}" '
        f'style="stroke-width:{size / 4:.4f};font-size:{size * 2.2:.4f}px">{"".join(parts)}</svg>'
    )


def _extent(state: MissionState) -> tuple[float, float, float, float] | None:
    places = [
        *(zone.place for zone in state.zones.values() if zone.place is not None),
        *(survivor.place for survivor in state.survivors),
        *(Position(pose.x, pose.y) for pose in state.trail),
        *state.fence,
        *([state.base] if state.base is not None else []),
        *_corners(state),
    ]
    if not places:
        return None
    left, right = min(place.x for place in places), max(place.x for place in places)
    low, high = min(place.y for place in places), max(place.y for place in places)
    margin = max(right - left, high - low, 1.0) * _MARGIN
    extent = left - margin, low - margin, right + margin, high + margin
    # So far away that the numbers have no metres is nowhere.
    return extent if all(0.0 < extent[axis + 2] - extent[axis] < math.inf for axis in (0, 1)) else None


def _corners(state: MissionState) -> list[Position]:
    try:
        x, y, edge = (float(state.map[key]) for key in ("x", "y", "resolution"))
        turned = abs(float(state.map.get("yaw", 0.0))) > _TURNED_RAD
        width, height = int(state.map["width"]) * edge, int(state.map["height"]) * edge
    except (ArithmeticError, LookupError, TypeError, ValueError):
        return []
    corners = [Position(x, y), Position(x + width, y + height)]
    drawable = width > 0 < height and not turned
    return corners if drawable and all(map(math.isfinite, itertools.chain(*corners))) else []


def _image(state: MissionState) -> Iterator[str]:
    corners, png = _corners(state), str(state.map.get("png"))
    if corners and _BASE64.fullmatch(png):
        low, high = corners
        yield (
            f'<image x="{low.x:g}" y="{-high.y:g}" width="{high.x - low.x:g}" height="{high.y - low.y:g}" '
            f'preserveAspectRatio="none" href="data:image/png;base64,{png}"/>'
        )


def _grid(extent: tuple[float, float, float, float], size: float) -> Iterator[str]:
    """Yield lines in the distance of a round number of metres, which is said in a corner."""
    left, low, right, high = extent
    step = 10.0 ** math.floor(math.log10(max(right - left, high - low)))
    if max(right - left, high - low) / step < 3:  # noqa: PLR2004 - so that there are some
        step /= 5.0
    for x in _multiples(left, right, step):
        yield f'<line class="grid" x1="{x:g}" y1="{-high:.3f}" x2="{x:g}" y2="{-low:.3f}"/>'
    for y in _multiples(low, high, step):
        yield f'<line class="grid" x1="{left:.3f}" y1="{-y:g}" x2="{right:.3f}" y2="{-y:g}"/>'
    yield f'<text class="scale" x="{left + size:.3f}" y="{-low - size:.3f}">grid {step:g} m</text>'


def _multiples(first: float, last: float, step: float) -> Iterable[float]:
    return (number * step for number in range(math.ceil(first / step), math.floor(last / step) + 1))


def _fence(state: MissionState) -> Iterator[str]:
    if state.fence:
        yield f'<polygon class="fence" points="{_points(state.fence)}"/>'


def _path(state: MissionState) -> Iterator[str]:
    for way in _ways(state.trail):
        yield f'<polyline class="path" points="{_points([Position(pose.x, pose.y) for pose in way])}"/>'


def _ways(trail: list[RobotPose]) -> Iterator[list[RobotPose]]:
    """Yield the parts of a trail between jumps and runs."""
    way: list[RobotPose] = []
    for pose in trail:
        last = way[-1] if way else pose
        if last.at.run != pose.at.run or math.hypot(pose.x - last.x, pose.y - last.y) > _JUMP_M:
            yield way
            way = []
        way.append(pose)
    yield way


def _places(state: MissionState, right: float, size: float) -> Iterator[str]:
    if state.base is not None:
        x, y = state.base.x, -state.base.y
        yield f'<rect class="base" x="{x - size:.3f}" y="{y - size:.3f}" width="{2 * size:.3f}" height="{2 * size:.3f}"/>'
        yield _label(state.base, right, size, "base")
    for zone in state.zones.values():
        if zone.place is not None:
            x, y = zone.place.x, -zone.place.y
            yield f'<circle class="zone {_kind(zone)}" cx="{x:.3f}" cy="{y:.3f}" r="{1.2 * size:.3f}"/>'
            yield _label(zone.place, right, size, zone.name)
            if zone.said != "searched":
                yield _label(zone.place, right, size, zone.said, "said")
    for survivor in state.survivors:
        x, y = survivor.place.x, -survivor.place.y
        corners = ((x, y - 1.6 * size), (x + 1.6 * size, y), (x, y + 1.6 * size), (x - 1.6 * size, y))
        points = " ".join(f"{a:.3f},{b:.3f}" for a, b in corners)
        yield f'<polygon class="survivor {escape(visible(survivor.standing))}" points="{points}"/>'
        yield _label(survivor.place, right, size, survivor.name or "survivor", "name")


def _kind(zone: ZoneState) -> str:
    if zone.searched is not None:
        return "searched"
    return zone.state if zone.state in ("visited", "abandoned") else "open"


def _label(place: Position, right: float, size: float, text: str, kind: str = "") -> str:
    """Return a text beside a place; on the left of it where there would be no room."""
    anchor, x = (
        ("end", place.x - 2 * size) if place.x > right - _LABEL * size else ("start", place.x + 2 * size)
    )
    y = -place.y + size * _BELOW[kind]
    return (
        f'<text class="{kind}" text-anchor="{anchor}" x="{x:.3f}" y="{y:.3f}">{escape(visible(text))}</text>'
    )


def _points(places: Iterable[Position]) -> str:
    return " ".join(f"{place.x:.3f},{-place.y:.3f}" for place in places)
