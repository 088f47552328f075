"""The map of a report as SVG: the landmarks of the mission, and the robot's path."""

import itertools
import math
import re
from collections.abc import Iterable, Iterator
from html import escape

from sar_compiler.journal.mission_state import MissionState, RobotPose
from sar_compiler.journal.situation import Landmark, Level
from sar_compiler.tree.showing import visible

# A picture that is not as a journal has it is left out.
_BASE64 = re.compile(r"[A-Za-z0-9+/]+=*", re.ASCII)
# Symbols are this part of the longer edge.
_SYMBOL = 1 / 90
_MARGIN = 1 / 20
# A label takes so many symbols' room.
_LABEL = 20
# How far below a place a label stands, in symbols: the name of a find hides neither another place's, nor what is said of that.
_BELOW = {"": 0.8, "name": -0.6, "said": 2.5}
# A break of so many metres in the path is no way of a robot: it was carried, or the localisation has jumped.
_JUMP_M = 5.0
# A map that is turned by less is drawn as if it were not.
_TURNED_RAD = 1e-3

# As SVG around the origin, in units of a symbol; other shapes are drawn as a circle.
_SHAPES = {
    "triangle": '<polygon class="{}" points="0,-1.7 1.6,1.2 -1.6,1.2"/>',
    "house": '<polygon class="{}" points="-1.1,1.1 -1.1,-0.3 0,-1.5 1.1,-0.3 1.1,1.1"/>',
    "square": '<rect class="{}" x="-1.1" y="-1.1" width="2.2" height="2.2"/>',
    "circle": '<circle class="{}" r="1.2"/>',
}
_AREA, _WAY = '<polyline class="{}" points="-2,0 2,0"/>', '<polyline class="path" points="-2,0 2,0"/>'


def legend(state: MissionState) -> Iterator[tuple[str, str]]:
    """Yield each kind of symbol on the map once: its drawing, in units of a symbol around the origin, and its words."""
    drawn = {(_symbol(state, each), _words(state, each)): None for each in state.situation.landmarks.values()}
    yield from drawn
    if len(state.trail) > 1:
        yield _WAY, "way of the robot"


def _symbol(state: MissionState, landmark: Landmark) -> str:
    shape = (
        _AREA if landmark.corners else _SHAPES.get(state.situation.kind_of(landmark).shape, _SHAPES["circle"])
    )
    return shape.format(_class(state, landmark))


def _class(state: MissionState, landmark: Landmark) -> str:
    level = Level(landmark.level).name.lower().replace("_", "-")
    found = " found" if state.situation.kind_of(landmark).is_found else ""
    return f"landmark {level}{found}{' certain' if landmark.is_certain else ''}{' area' if landmark.corners else ''}"


def _words(state: MissionState, landmark: Landmark) -> str:
    kind = state.situation.kind_of(landmark)
    return visible(f"{kind.name}, {landmark.state}" if landmark.state else kind.name)


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
        *_areas(state),
        *_path(state),
        *_places(state, right, size),
    ]
    box = f"{left:.3f} {-high:.3f} {right - left:.3f} {high - low:.3f}"
    plurals = ", ".join(kind.plural for kind in state.situation.kinds.values())
    label = escape(visible(f"Map: the way of the robot{', ' if plurals else ''}{plurals}"))
    return (
        f'<svg class="map" viewBox="{box}" role="img" aria-label="{label}" '
        f'style="stroke-width:{size / 4:.4f};font-size:{size * 2.2:.4f}px">{"".join(parts)}</svg>'
    )


def _extent(state: MissionState) -> tuple[float, float, float, float] | None:
    landmarks = state.situation.landmarks.values()
    places = [
        *((each.x, each.y) for each in landmarks),
        *(corner for each in landmarks for corner in each.corners),
        *((pose.x, pose.y) for pose in state.trail),
        *_corners(state),
    ]
    if not places:
        return None
    (left, low), (right, high) = (tuple(map(function, zip(*places, strict=True))) for function in (min, max))
    margin = max(right - left, high - low, 1.0) * _MARGIN
    extent = left - margin, low - margin, right + margin, high + margin
    # So far away that the numbers have no metres is nowhere.
    return extent if all(0.0 < extent[axis + 2] - extent[axis] < math.inf for axis in (0, 1)) else None


def _corners(state: MissionState) -> list[tuple[float, float]]:
    try:
        x, y, edge = (float(state.map[key]) for key in ("x", "y", "resolution"))
        turned = abs(float(state.map.get("yaw", 0.0))) > _TURNED_RAD
        width, height = int(state.map["width"]) * edge, int(state.map["height"]) * edge
    except (ArithmeticError, LookupError, TypeError, ValueError):
        return []
    corners = [(x, y), (x + width, y + height)]
    drawable = width > 0 < height and not turned
    return corners if drawable and all(map(math.isfinite, itertools.chain(*corners))) else []


def _image(state: MissionState) -> Iterator[str]:
    corners, png = _corners(state), str(state.map.get("png"))
    if corners and _BASE64.fullmatch(png):
        (left, low), (right, high) = corners
        yield (
            f'<image x="{left:g}" y="{-high:g}" width="{right - left:g}" height="{high - low:g}" '
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


def _areas(state: MissionState) -> Iterator[str]:
    for each in state.situation.landmarks.values():
        if each.corners:
            yield f'<polygon class="{_class(state, each)}" points="{_points(each.corners)}"/>'


def _path(state: MissionState) -> Iterator[str]:
    for way in _ways(state.trail):
        yield f'<polyline class="path" points="{_points((pose.x, pose.y) for pose in way)}"/>'


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
    for each in state.situation.landmarks.values():
        if each.corners:
            continue
        found, place = state.situation.kind_of(each).is_found, (each.x, each.y)
        yield f'<g transform="translate({each.x:.3f} {-each.y:.3f}) scale({size:.4f})">{_symbol(state, each)}</g>'
        yield _label(place, right, size, each.name, "name" if found else "")
        if each.state and not found and each.level != Level.DONE:
            yield _label(place, right, size, each.state, "said")


def _label(place: tuple[float, float], right: float, size: float, text: str, kind: str = "") -> str:
    """Return a text beside a place; on the left of it where there would be no room."""
    anchor, x = (
        ("end", place[0] - 2 * size) if place[0] > right - _LABEL * size else ("start", place[0] + 2 * size)
    )
    y = -place[1] + size * _BELOW[kind]
    return (
        f'<text class="{kind}" text-anchor="{anchor}" x="{x:.3f}" y="{y:.3f}">{escape(visible(text))}</text>'
    )


def _points(places: Iterable[tuple[float, float]]) -> str:
    return " ".join(f"{x:.3f},{-y:.3f}" for x, y in places)
