"""Creates the report of a mission as one self-contained HTML page, which can be printed and forwarded.

The page contains a map in SVG with the mission's landmarks and the path of the robot.
"""

import functools
import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from importlib.resources import files
from typing import Any, NamedTuple

from sar_compiler.journal.display import EventTime, Landmark, Level
from sar_compiler.journal.journal_entries import FACTS_LOST
from sar_compiler.journal.mission_state import KnownEvent, MissionState, RobotPose
from sar_compiler.journal.open_tasks import find_open_tasks
from sar_compiler.journal.status_line import GOOD, condition
from sar_compiler.reports.mission_report import detections_to_visit, georeference, unfinished_locations
from sar_compiler.reports.why import CauseOfFailure, likeliest_cause
from sar_compiler.runtime.clock import clock_text
from sar_compiler.style import FOUND, LEVELS, MARKS, sign_of, style
from sar_compiler.tree.display_text import visible
from sar_compiler.views.mission_view import status_sign

# The width and height of a plot's field, and the space for labels to its left and below it.
_PLOT = (640, 140, 60, 30)
_SHARES = (0, 50, 100)
_CLOCK = "%H:%M:%S"
_NONE = "-"
# The maximum number of events in the part for coordinators.
_MOST_EVENTS = 12
_POSITION = ("x, y in map (m)", "latitude, longitude")


@functools.cache
def _macros() -> Any:
    """Return the macros of the page template. These macros escape all text.

    Raises:
        ImportError: If Jinja2 is not installed.
    """
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    def format_value(value: object) -> object:
        return value if isinstance(value, Markup) else visible(str(value))

    source = files(__package__).joinpath("report.html.jinja").read_text("utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, finalize=format_value)
    environment.globals |= {"is_number": _is_number, "value": _value, "sign": status_sign}
    return environment.from_string("".join(map(str.strip, source.splitlines()))).module


def html_report(state: MissionState, why: CauseOfFailure | None = None) -> str:
    """Return the report of a mission as an HTML page in which all text is escaped.

    Raises:
        ImportError: If Jinja2 is not installed, or if the map has a georeference and pyproj is not installed.
    """
    from markupsafe import Markup

    now, drawing = condition(state), _drawing(state)
    seeks = any(kind.is_found for kind in state.situation.kinds.values())
    simulated = f"SIMULATED. Do not act on this report{': no real people were involved' if seeks else ''}."
    is_simulated = bool(state.about.get("simulated"))
    about = state.runs[-1].about if state.runs else {}
    software = f"sar_compiler {about.get('version') or ''}, node {about.get('node') or _NONE}"
    if head := state.head:
        software += f", head of the journal {head}"
    report = {
        "title": f"Report: {state.title}, {_day(state.runs[0].began) if state.runs else 'not begun'}",
        "css": Markup(style() + files(__package__).joinpath("report.css").read_text("utf-8")),  # noqa: S704 - ours
        "mission": state.title,
        "simulated": simulated if is_simulated else "",
        "is_good": now.level == GOOD,
        "outcome": now.to_line(state.now.time),
        "facts": [*_summary_lines(state)],
        "found": [*_landmarks(state, is_found=True)],
        "courses": [
            (f"{name[:1].upper()}{name[1:]}", _figure_plot(state, name, course))
            for name, course in state.figure_history.items()
            if len({value for _, value in course}) > 1
        ],
        "map": drawing,
        "legend": _legend(state) if drawing else (),
        "others": [*_landmarks(state, is_found=False)],
        "next_steps": [] if is_simulated else [*next_steps(state)],
        "limits": [*limits(state)],
        "commands": [each for each in state.facts if each.by],
        "events": _first_and_last(state.facts, _MOST_EVENTS),
        "first": likeliest_cause(why) if why is not None else "",
        "software": software,
    }
    return f"{_macros().page(report, state, functools.partial(_local_time, state))}\n"


def _first_and_last(facts: Sequence[KnownEvent], count: int) -> list[KnownEvent]:
    """Return at most *count* events: a third of the count from the beginning, and the rest from the end."""
    first = count // 3
    return [*facts] if len(facts) <= count else [*facts[:first], *facts[first - count :]]


def _summary_lines(state: MissionState) -> Iterator[tuple[str, str]]:
    """Yield the lines of the summary. Each line is a pair of a term and a description."""
    for run in state.runs:
        yield (f"run {run.number}" if len(state.runs) > 1 else "time", _duration(run.began, run.ended))
    if state.runs and not state.runs[-1].ending:
        yield "as of", _day(state.now)
    for figure in state.situation.figures.values():
        yield figure.name, figure.text.removeprefix(figure.name).strip()
    for word, places in unfinished_locations(state).items():
        yield word, ", ".join(places)
    if state.is_told:
        yield "robot", _robot(state)
    if (place := georeference(state)) is not None:
        yield (
            "place",
            f"origin of the map at {place.lat:.7f}, {place.lon:.7f} (WGS 84), x axis {place.heading:g}° clockwise from north",
        )


def _robot(state: MissionState) -> str:
    place = state.situation.phase.place
    if any(each.name == place and each.level == Level.DONE for each in state.situation.landmarks.values()):
        return f"at {place}"
    return f"last seen at ({state.pose.x:.2f}, {state.pose.y:.2f})" if state.pose is not None else "unknown"


def _landmarks(state: MissionState, *, is_found: bool) -> Iterator[Mapping[str, object]]:
    """Yield a table for each kind of detection or, without *is_found*, for each other kind with states."""
    situation = state.situation
    for kind in situation.kinds.values():
        listed = situation.of_kind(kind.name)
        if kind.is_found != is_found or not (is_found or any(each.state for each in listed)):
            continue
        names = [*dict.fromkeys(name for each in listed for name in each.details)]
        within = ["in"] if any(each.within for each in listed) else []
        heads = ("name", "state", *within, *_POSITION[: 1 + (georeference(state) is not None)], *names)
        rows = [(_level(state, each), _landmark(state, each, within, names)) for each in listed]
        empty = f"No {kind.plural} {'are known' if situation.alarms else 'were found'}."
        yield {"title": kind.plural.capitalize(), "heads": heads, "rows": rows, "empty": empty}


def _level(state: MissionState, landmark: Landmark) -> str:
    found = f" {FOUND.word}" if state.situation.kind_of(landmark).is_found else ""
    level = LEVELS[landmark.level].word
    return f"{level}{found}{' certain' if landmark.is_certain else ''}"


def _landmark(
    state: MissionState, landmark: Landmark, within: Sequence[str], names: Sequence[str]
) -> list[str]:
    return [
        landmark.name,
        f"{landmark.state}{f': {landmark.reason}' if landmark.reason else ''}" or _NONE,
        *([landmark.within or _NONE] if within else []),
        *_position(state, landmark.x, landmark.y),
        *(_detail(state, landmark.details.get(name)) for name in names),
    ]


def _detail(state: MissionState, value: Any) -> str:
    if value is None:
        return _NONE
    return _local_time(state, value) if isinstance(value, EventTime) else _value(value)


def next_steps(state: MissionState) -> Iterator[str]:
    """Yield the tasks for readers of the report: visits to detections, open tasks, and requests for data."""
    finds = detections_to_visit(state)
    for find in finds:
        known = "confirmed" if find.is_certain else "not confirmed"
        yield f"Go to {find.name} at {_position(state, find.x, find.y)[-1]} ({known})"
    yield from (task.text for task in find_open_tasks(state, with_visits=False) if not task.is_alarm)
    if finds and georeference(state) is None:
        yield (
            "These are map coordinates. For latitude and longitude, run: sar-journal report … --georeference "
            "LAT,LON,HEADING"
        )
    if state.runs and not state.runs[-1].ending:
        yield f"Ask for a later report: the run had not ended at {_day(state.now)}"


def limits(state: MissionState) -> Iterator[str]:
    """Yield the limitations of the report that readers must know."""
    found = [each for each in state.situation.detections() if each.level != Level.GIVEN_UP]
    if unsure := [each.name for each in found if not each.is_certain]:
        yield f"No person has confirmed {', '.join(unsure)}"
    for figure in state.situation.figures.values():
        if figure.of is not None and figure.value < figure.of:
            yield f"Incomplete: {figure.text}"
        elif figure.unit == "%" and figure.name.startswith("probability"):
            yield f"{figure.text}: this value depends on the probabilities that were set before the run"
    if lost := sum(int(fact.data.get("count", 0)) for fact in state.facts if fact.kind == FACTS_LOST):
        yield f"{lost} events could not be recorded"
    if state.assumption_failed_at is not None:
        yield "The run contradicted an assumption on which the verification of the tree depends"
    if state.runs and not state.runs[-1].ending:
        yield "The end of the run is not recorded"
    if state.situation.landmarks:
        frame = (
            ""
            if georeference(state) is not None
            else " Positions are coordinates on the robot's map, not latitude and longitude."
        )
        yield f"Positions are only as accurate as the robot's localisation.{frame}".rstrip(".")


def _is_number(text: str) -> bool:
    """Return whether the text of a table cell is a time, a coordinate or another number."""
    return text[:1] in "-0123456789" and len(text) < 26  # noqa: PLR2004


def _position(state: MissionState, x: float, y: float) -> list[str]:
    reference, cells = georeference(state), [f"{x:.2f}, {y:.2f}"]
    if reference is not None:
        lat, lon = reference.to_coordinates(x, y)
        cells.append(f"{lat:.7f}, {lon:.7f}")
    return cells


def _local_time(state: MissionState, instant: EventTime | None) -> str:
    """Return local time and mission time.

    Add the run if there are several, and the day if it is not the first.
    """
    if instant is None:
        return _NONE
    run = f"run {instant.run}, " if len(state.runs) > 1 else ""
    day = _day(instant, "%Y-%m-%d")
    is_first = bool(state.runs) and day == _day(state.runs[0].began, "%Y-%m-%d")
    return f"{run}{'' if is_first else f'{day} '}{_day(instant, _CLOCK)} ({clock_text(instant.time)})"


def _day(instant: EventTime, form: str = "%Y-%m-%d %H:%M:%S %z") -> str:
    """Return the local time with the UTC offset, or the mission's clock if the local time is out of range."""
    try:
        return datetime.fromtimestamp(instant.wall).astimezone().strftime(form)
    except (OSError, OverflowError, ValueError):
        return clock_text(instant.time)


def _duration(began: EventTime, ended: EventTime | None) -> str:
    if ended is None:
        return f"{_day(began)}, end unknown"
    return f"{_day(began)} to {_day(ended)}, {clock_text(ended.time)} on the mission's clock"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return ", ".join(map(_value, value)) if isinstance(value, list) else str(value)


# The Base64 text of a picture. Any other text is omitted.
_BASE64 = re.compile(r"[A-Za-z0-9+/]+=*", re.ASCII)
# The size of a symbol and the margin of the map, as fractions of the map's longer edge.
_SYMBOL = 1 / 90
_MARGIN = 1 / 20
# The size of a mark's unit, in symbols. Marks are about 24 units wide.
_MARK = 0.12
# The size of a label's letters in symbols, the relative size of a state's letters, and the ratio of width to height.
_LETTER, _STATE, _WIDE = 2.2, 0.7, 0.62
# The distance of a label from the middle of its mark, in symbols.
_BESIDE = 1.9
# The cost of a label's area outside the map, relative to an area that covers other objects.
_OUTSIDE = 4
# A longer gap in the path is not a movement: the robot was carried, or its localisation has jumped.
_JUMP_M = 5.0
# A map image with a larger rotation is not drawn; a smaller rotation is ignored.
_TURNED_RAD = 1e-3


class _Symbol(NamedTuple):
    """The symbol of a landmark on the map: a mark, or the outline of an area.

    Attributes:
        is_area: Whether the landmark is an area.
        level: The CSS classes of the symbol.
        path: The SVG path of a mark, around the origin.
        sign: The sign inside a mark.
    """

    is_area: bool
    level: str
    path: str = ""
    sign: str = ""


def _legend(state: MissionState) -> Sequence[tuple[_Symbol | None, str]]:
    """Return a description for each different symbol on the map.

    The symbol None stands for the robot's path.
    """
    drawn = {
        (_symbol(state, each), _landmark_text(state, each)): None
        for each in state.situation.landmarks.values()
    }
    return [*drawn, *([(None, "path of the robot")] if len(state.trail) > 1 else [])]


def _symbol(state: MissionState, landmark: Landmark) -> _Symbol:
    kind, level = state.situation.kind_of(landmark), _level(state, landmark)
    if landmark.corners:
        return _Symbol(is_area=True, level=level)
    sign = sign_of(landmark.level, is_found=kind.is_found)
    return _Symbol(False, level, MARKS.get(kind.shape, MARKS["circle"]), sign or "")  # noqa: FBT003


def _landmark_text(state: MissionState, landmark: Landmark) -> str:
    kind = state.situation.kind_of(landmark)
    return f"{kind.name}, {landmark.state}" if landmark.state else kind.name


class MapBox(NamedTuple):
    """A rectangle in the frame `map`, in metres."""

    left: float
    low: float
    right: float
    high: float


def _figure_plot(
    state: MissionState, name: str, course: Sequence[tuple[EventTime, float]]
) -> Mapping[str, object]:
    """Return the data for a plot of a percentage over time, with an axis from 0 to 100 %."""
    began, (width, height, left, low) = course[0][0].wall, _PLOT
    whole = max(state.now.wall - began, 1e-9)

    def point(wall: float, value: float) -> str:
        return f"{left + width * (wall - began) / whole:.1f},{5 + height * (1 - min(max(value, 0), 100) / 100):.1f}"

    # A value is valid until the next value.
    ends = [*(moment.wall for moment, _ in course[1:]), state.now.wall]
    steps = [
        point(wall, value)
        for (moment, value), end in zip(course, ends, strict=True)
        for wall in (moment.wall, end)
    ]
    shares = [
        {
            "share": share,
            "points": f"{point(began, share)} {point(began + whole, share)}",
            "y": f"{9 + height * (1 - share / 100):.0f}",
        }
        for share in _SHARES
    ]
    return {
        "width": left + width + 5,
        "height": height + low,
        "left": left,
        "right": left + width,
        "shares": shares,
        "began": _day(course[0][0], _CLOCK),
        "ended": _day(state.now, _CLOCK),
        "points": " ".join(steps),
        "label": f"{name}: {course[0][1]:g} % at the start, {course[-1][1]:g} % at the end",
    }


def report_map(state: MissionState) -> str:
    """Return the map as an SVG element, or an empty string if no position is known."""
    drawing = _drawing(state)
    return str(_macros().map(drawing)) if drawing is not None else ""


def _drawing(state: MissionState) -> Mapping[str, object] | None:
    """Return the content of the map, or None if no position is known."""
    extent = _extent(state)
    if extent is None:
        return None
    left, low, right, high = extent
    size = max(right - left, high - low) * _SYMBOL
    landmarks = state.situation.landmarks.values()
    places = [each for each in landmarks if not each.corners]
    plurals = ", ".join(kind.plural for kind in state.situation.kinds.values())
    step = _grid_step(extent)
    return {
        "box": f"{left:.3f} {-high:.3f} {right - left:.3f} {high - low:.3f}",
        "label": f"Map: the path of the robot{', ' if plurals else ''}{plurals}",
        "stroke": f"{size / 4:.4f}",
        "letters": f"{size * _LETTER:.4f}",
        "image": _image(state),
        "grid": [*_grid(extent, step)],
        "north": _north(state, extent, size),
        "scale": {"x": f"{left + size:.3f}", "y": f"{-low - size:.3f}", "step": f"{step:g}"},
        "areas": [(_level(state, each), _points(each.corners)) for each in landmarks if each.corners],
        "ways": [_points((pose.x, pose.y) for pose in path) for path in _split_trail(state.trail)],
        "marks": [(f"{each.x:.3f}", f"{-each.y:.3f}", _symbol(state, each)) for each in places],
        "mark_scale": f"{size * _MARK:.5f}",
        "labels": [*_labels(state, places, extent, size)],
    }


def _north(state: MissionState, extent: MapBox, size: float) -> Mapping[str, object]:
    """Return the sign in the map's upper right corner: an arrow to the north, or axes if north is unknown."""
    place = georeference(state)
    return {
        "x": f"{extent.right - 4 * size:.3f}",
        "y": f"{4 * size - extent.high:.3f}",
        "scale": f"{size * _MARK:.5f}",
        "turn": None if place is None else f"{90.0 - place.heading:.1f}",
    }


def _extent(state: MissionState) -> MapBox | None:
    landmarks = state.situation.landmarks.values()
    places = [
        *((each.x, each.y) for each in landmarks),
        *(corner for each in landmarks for corner in each.corners),
        *((pose.x, pose.y) for pose in state.trail),
        *_map_corners(state),
    ]
    if not places:
        return None
    (left, low), (right, high) = (tuple(map(function, zip(*places, strict=True))) for function in (min, max))
    margin = max(right - left, high - low, 1.0) * _MARGIN
    extent = MapBox(left - margin, low - margin, right + margin, high + margin)
    # If positions are so large that floating-point numbers cannot resolve metres, there is no map.
    return extent if all(0.0 < extent[axis + 2] - extent[axis] < math.inf for axis in (0, 1)) else None


def _map_corners(state: MissionState) -> list[tuple[float, float]]:
    try:
        x, y, edge = (float(state.map[key]) for key in ("x", "y", "resolution"))
        turned = abs(float(state.map.get("yaw", 0.0))) > _TURNED_RAD
        width, height = int(state.map["width"]) * edge, int(state.map["height"]) * edge
    except (ArithmeticError, LookupError, TypeError, ValueError):
        return []
    corners = [(x, y), (x + width, y + height)]
    drawable = width > 0 < height and not turned
    return corners if drawable and all(map(math.isfinite, itertools.chain(*corners))) else []


def _image(state: MissionState) -> Mapping[str, str] | None:
    corners, png = _map_corners(state), str(state.map.get("png"))
    if not corners or not _BASE64.fullmatch(png):
        return None
    (left, low), (right, high) = corners
    size = {"width": f"{right - left:g}", "height": f"{high - low:g}"}
    return {"x": f"{left:g}", "y": f"{-high:g}", **size, "png": png}


def _grid_step(extent: MapBox) -> float:
    """Return the distance between the grid lines of the map, as a round number of metres."""
    longer = max(extent.right - extent.left, extent.high - extent.low)
    step: float = 10.0 ** math.floor(math.log10(longer))
    return step / 5.0 if longer / step < 3 else step  # noqa: PLR2004 - at least three lines


def _grid(extent: MapBox, step: float) -> Iterator[tuple[str, str, str, str]]:
    """Yield the end points of each grid line of the map, as SVG coordinates."""
    left, low, right, high = extent
    for x in _multiples(left, right, step):
        yield f"{x:g}", f"{-high:.3f}", f"{x:g}", f"{-low:.3f}"
    for y in _multiples(low, high, step):
        yield f"{left:.3f}", f"{-y:g}", f"{right:.3f}", f"{-y:g}"


def _multiples(first: float, last: float, step: float) -> Iterable[float]:
    return (number * step for number in range(math.ceil(first / step), math.floor(last / step) + 1))


def _split_trail(trail: list[RobotPose]) -> Iterator[list[RobotPose]]:
    """Split a trail at jumps and at the starts of runs, and yield the parts."""
    path: list[RobotPose] = []
    for pose in trail:
        last = path[-1] if path else pose
        if last.at.run != pose.at.run or math.hypot(pose.x - last.x, pose.y - last.y) > _JUMP_M:
            yield path
            path = []
        path.append(pose)
    yield path


def _labels(
    state: MissionState, places: Sequence[Landmark], extent: MapBox, size: float
) -> Iterator[tuple[str, str, str, str, str]]:
    """Yield each text line of the landmarks' labels, with its CSS class, text anchor and position."""
    taken = [_box_around(each.x, each.y, 1.5 * size, 1.5 * size) for each in places]
    for each in places:
        found = state.situation.kind_of(each).is_found
        shown_state = each.state if not found and each.level != Level.DONE else ""
        label = _label(each, shown_state, size, taken, extent)
        taken.append(label.box)
        yield label.line(each.name, "name" if found else "", 0.8 * _LETTER * size)
        if shown_state:
            yield label.line(shown_state, "said", 1.6 * _LETTER * size)


class _Label(NamedTuple):
    """The position of a label: its box, and the x position (in metres) and anchor of its text lines."""

    box: MapBox
    x: float
    anchor: str

    def line(self, text: str, kind: str, down: float) -> tuple[str, str, str, str, str]:
        """Return the data of an SVG text line. Its baseline is *down* metres below the upper edge of the box."""
        return text, kind, self.anchor, f"{self.x:.3f}", f"{down - self.box.high:.3f}"


def _label(landmark: Landmark, text: str, size: float, taken: Sequence[MapBox], extent: MapBox) -> _Label:
    """Return the position where a label covers least: right of, left of, below or above the landmark.

    Args:
        landmark: The landmark.
        text: The text below the landmark's name.
        size: The size of a symbol, in metres.
        taken: The boxes that should not be covered.
        extent: The visible part of the map.
    """
    x, y, away = landmark.x, landmark.y, _BESIDE * size
    wide = max(len(landmark.name), len(text) * _STATE) * _WIDE * _LETTER * size / 2
    high = (1.0 + (_STATE if text else 0.0)) * _LETTER * size / 2
    sides = (
        _Label(_box_around(x + away + wide, y, wide, high), x + away, "start"),
        _Label(_box_around(x - away - wide, y, wide, high), x - away, "end"),
        _Label(_box_around(x, y - away - high, wide, high), x, "middle"),
        _Label(_box_around(x, y + away + high, wide, high), x, "middle"),
    )

    def hidden_area(label: _Label) -> float:
        outside = 4 * wide * high - _overlap(label.box, extent)
        return _OUTSIDE * outside + sum(_overlap(label.box, each) for each in taken)

    return min(sides, key=hidden_area)


def _box_around(x: float, y: float, wide: float, high: float) -> MapBox:
    return MapBox(x - wide, y - high, x + wide, y + high)


def _overlap(one: MapBox, other: MapBox) -> float:
    """Return the area that two boxes have in common, in square metres."""
    width = min(one.right, other.right) - max(one.left, other.left)
    height = min(one.high, other.high) - max(one.low, other.low)
    return max(0.0, width) * max(0.0, height)


def _points(places: Iterable[tuple[float, float]]) -> str:
    return " ".join(f"{x:.3f},{-y:.3f}" for x, y in places)
