"""The report of a mission as one page of HTML, with all that it needs, to be read, printed and handed on.

Its map, in SVG, shows what the mission shows, and the way of the robot.
"""

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from html import escape
from importlib.resources import files
from typing import Any, NamedTuple

from sar_compiler.journal.condition import GOOD, condition
from sar_compiler.journal.mission_state import MissionState, NodeState, RobotPose
from sar_compiler.journal.situation import EventTime, Landmark, Level
from sar_compiler.reports.mission_report import georeference, not_done, to_visit
from sar_compiler.reports.why import Why, first_to_look_at
from sar_compiler.runtime.clock import clock_text
from sar_compiler.style import FOUND, LEVELS, MARKS, sign_of, style
from sar_compiler.tree.showing import visible
from sar_compiler.views.mission_view import sign

# Of a plot: the width and the height of its field, and what is left for the words left of it and below.
_PLOT = (640, 140, 60, 30)
_SHARES = (0, 50, 100)
_CLOCK = "%H:%M:%S"
_NONE = "-"
_POSITION = ("x, y in map (m)", "latitude, longitude")
# Of the log's warnings so many are told, and of the facts.
_MOST_WARNINGS, _MOST_FACTS = 200, 1000
# As in rcl_interfaces/msg/Log.
_ERROR = 40

# It shows; whatever has got into it, nothing of it runs or is fetched from anywhere.
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"


def html_report(state: MissionState, why: Why | None = None) -> str:
    """Return the report of a mission, and why it has failed, as an HTML page; all text from outside is escaped.

    Raises:
        ImportError: If pyproj is not installed, and the map's place on the earth is known.
    """
    title = f"Report: {state.title}, {_day(state.runs[0].began) if state.runs else 'not begun'}"
    found, others = (_landmarks(state, is_found=each) for each in (True, False))
    parts = (
        _head(state),
        found,
        _courses(state),
        _map(state),
        others,
        _alarms(state),
        _properties(state),
        _next_steps(state),
        _annex(state, why),
    )
    body = "".join(itertools.chain(*parts))
    css = style() + files(__package__).joinpath("report.css").read_text("utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{_text(title)}</title><style>\n{css}</style></head>\n<body><main>{body}</main></body></html>\n"
    )


def _head(state: MissionState) -> Iterator[str]:
    now = condition(state)
    yield f"<header><h1>{_text(state.title)}</h1>"
    if state.about.get("simulated"):
        seeks = any(kind.is_found for kind in state.situation.kinds.values())
        yield f'<p class="simulated">Simulated{": nobody was searched for, nobody was found" if seeks else ""}</p>'
    yield f'<p class="outcome{"" if now.level == GOOD else " bad"}">{_text(now.text(state.now.time))}</p>'
    facts: list[tuple[str, str]] = [
        (f"run {run.number}" if len(state.runs) > 1 else "time", _duration(run.began, run.ended))
        for run in state.runs
    ]
    if state.runs and not state.runs[-1].ending:
        facts.append(("as of", _day(state.now)))
    figures = state.situation.figures.values()
    facts += [(each.name, each.text.removeprefix(each.name).strip()) for each in figures]
    facts += [(word, ", ".join(places)) for word, places in not_done(state).items()]
    if state.is_told:
        facts.append(("robot", _robot(state)))
    place = georeference(state)
    if place is not None:
        where = f"origin of the map at {place.lat:.7f}, {place.lon:.7f} (WGS 84), its x axis {place.heading:g}° from north"
        facts.append(("place", where))
    items = "".join(f"<dt>{_text(key)}</dt><dd>{_text(value)}</dd>" for key, value in facts)
    yield f"<dl>{items}</dl></header>"


def _robot(state: MissionState) -> str:
    place = state.situation.phase.place
    if any(each.name == place and each.level == Level.DONE for each in state.situation.landmarks.values()):
        return f"at {place}"
    return f"last seen at ({state.pose.x:.2f}, {state.pose.y:.2f})" if state.pose is not None else "not known"


def _landmarks(state: MissionState, *, is_found: bool) -> Iterator[str]:
    """Yield a table for each kind of landmarks of which there is more to say than where they are."""
    situation = state.situation
    for kind in situation.kinds.values():
        listed = situation.of_kind(kind.name)
        if kind.is_found != is_found or not (is_found or any(each.state for each in listed)):
            continue
        names = [*dict.fromkeys(name for each in listed for name in each.details)]
        within = ["in"] if any(each.within for each in listed) else []
        heads = ("name", "state", *within, *_POSITION[: 1 + (georeference(state) is not None)], *names)
        rows = ((_level(state, each), _landmark(state, each, within, names)) for each in listed)
        yield _table(
            kind.plural.capitalize(), heads, rows, "None is known." if situation.alarms else "None was found."
        )


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
    return _when(state, value) if isinstance(value, EventTime) else _value(value)


def _map(state: MissionState) -> Iterator[str]:
    drawing = report_map(state)
    if drawing:
        items = "".join(
            f'<li><svg class="key" viewBox="-14 -14 28 28" aria-hidden="true">{drawn}</svg>{_text(text)}</li>'
            for drawn, text in legend(state)
        )
        yield f'<h2>Map</h2>{drawing}<ul class="legend">{items}</ul>'


def _alarms(state: MissionState) -> Iterator[str]:
    rows = (
        (
            "" if each.is_over else "alarm",
            [_when(state, state.since[text]), text, "over" if each.is_over else _NONE],
        )
        for text, each in state.situation.alarms.items()
    )
    yield _table("Alarms", ("since", "what", "now"), rows)


def _properties(state: MissionState) -> Iterator[str]:
    rows = (
        (
            "alarm" if each.broken else "",
            [each.name, state.word_of(each), _when(state, each.broken), each.event],
        )
        for each in state.properties.values()
    )
    yield _table("Properties", ("property", "verdict", "broken", "by"), rows)


def _next_steps(state: MissionState) -> Iterator[str]:
    yield "<h2>What to do next</h2>"
    items = "".join(f"<li>{_text(step)}</li>" for step in next_steps(state))
    yield f"<ul>{items}</ul>" if items else "<p>The mission has left nothing to do.</p>"


def next_steps(state: MissionState) -> Iterator[str]:
    """Yield what a mission leaves to those who read its report: finds to go to, places to look at, what to ask for."""
    finds = to_visit(state)
    for find in finds:
        known = "confirmed" if find.is_certain else "nobody has confirmed it"
        late = "" if find.level == Level.DONE else ". The mission was not done with it: pass it on yourself"
        yield f"Go to {find.name} at {_position(state, find.x, find.y)[-1]} ({known}){late}"
    for word, places in not_done(state).items():
        yield f"See to {', '.join(places)}: {word}"
    if finds and georeference(state) is None:
        yield (
            "Have the report made with coordinates of the world, which these are not: sar-journal report … --georeference "
            "LAT,LON,HEADING"
        )
    if state.runs and not state.runs[-1].ending:
        yield f"Ask for a later report: this one is of {_day(state.now)}"


def _facts(state: MissionState) -> Iterator[str]:
    rows = (("", [_when(state, each.at), each.text]) for each in state.facts[:_MOST_FACTS])
    yield _table("What has happened", ("when", "what"), rows)
    yield _more(len(state.facts) - _MOST_FACTS)


def _faults(state: MissionState) -> Iterator[str]:
    rows = (
        ("", [_when(state, each.at), "error" if each.level >= _ERROR else "warning", each.by, each.text])
        for each in state.warnings[:_MOST_WARNINGS]
    )
    empty = "The log has no warnings and no errors."
    yield _table("Faults met", ("when", "kind", "of", "what"), rows, empty)
    yield _more(len(state.warnings) - _MOST_WARNINGS)


def _more(count: int) -> str:
    return f"<p class='quiet'>{count} more are in the journal.</p>" if count > 0 else ""


def _annex(state: MissionState, why: Why | None) -> Iterator[str]:
    yield '<section class="annex"><p class="quiet">From here on for engineers.</p>'
    if why is not None and (first := first_to_look_at(why)):
        yield f'<p class="first">{_text(first)}</p>'
    yield from _facts(state)
    yield from _faults(state)
    rows = (("", [name, _value(value)]) for name, value in sorted(state.parameters.items()))
    yield _table("Parameters", ("name", "value"), rows, "None were kept.")
    yield "<h2>Tree</h2><p class='quiet'>The last status of each node, and what it said then.</p><div class='wide'>"
    yield f'<table class="tree"><tbody>{"".join(map(_node, state.nodes))}</tbody></table></div></section>'
    about = state.runs[-1].about if state.runs else {}
    told = f"sar_compiler {about.get('version') or ''}, node {about.get('node') or _NONE}"
    if head := state.head:
        told += f", head of the journal {head}"
    yield f"<footer>{_text(told)}</footer>"


def _node(node: NodeState) -> str:
    name = f"{'  ' * node.depth}{sign(node.status)} {node.name}".replace("  ", "\u00a0\u00a0")
    cells = (name, node.message, node.place)
    return f'<tr class="{_text(node.status)}">{"".join(f"<td>{_text(cell)}</td>" for cell in cells)}</tr>'


def _table(
    title: str, heads: Sequence[str], rows: Iterable[tuple[str, Sequence[str]]], empty: str = ""
) -> str:
    """Return a table with its heading; each row has a class, and its cells.

    Without rows, there is what *empty* says instead; without that as well, nothing at all.
    """
    body = "".join(
        f'<tr class="{_text(kind)}">{"".join(map(_cell, heads, cells))}</tr>' for kind, cells in rows
    )
    if not body:
        return f"<h2>{_text(title)}</h2><p>{_text(empty)}</p>" if empty else ""
    head = f"<thead><tr>{''.join(f'<th>{_text(each)}</th>' for each in heads)}</tr></thead>"
    table = f'<table class="rows">{head}<tbody>{body}</tbody></table>'
    return f'<h2>{_text(title)}</h2><div class="wide">{table}</div>'


def _cell(head: str, text: str) -> str:
    is_number = text[:1] in "-0123456789" and len(text) < 26  # noqa: PLR2004 - a time, or a coordinate
    return f'<td class="{"number" if is_number else "text"}" data-head="{_text(head)}">{_text(text)}</td>'


def _position(state: MissionState, x: float, y: float) -> list[str]:
    reference, cells = georeference(state), [f"{x:.2f}, {y:.2f}"]
    if reference is not None:
        lat, lon = reference.located(x, y)
        cells.append(f"{lat:.7f}, {lon:.7f}")
    return cells


def _when(state: MissionState, instant: EventTime | None) -> str:
    """Return the local time, and the mission's clock; with the run if there are several, and another day than at the top."""
    if instant is None:
        return _NONE
    run = f"run {instant.run}, " if len(state.runs) > 1 else ""
    day = _day(instant, "%Y-%m-%d")
    is_first = bool(state.runs) and day == _day(state.runs[0].began, "%Y-%m-%d")
    return f"{run}{'' if is_first else f'{day} '}{_day(instant, _CLOCK)} ({clock_text(instant.time)})"


def _day(instant: EventTime, form: str = "%Y-%m-%d %H:%M:%S %z") -> str:
    """Return the local time, and its offset from UTC; the mission's clock if there is no such day."""
    try:
        return datetime.fromtimestamp(instant.wall).astimezone().strftime(form)
    except (OSError, OverflowError, ValueError):
        return clock_text(instant.time)


def _duration(began: EventTime, ended: EventTime | None) -> str:
    if ended is None:
        return f"{_day(began)}; no end is known"
    return f"{_day(began)} to {_day(ended)}, {clock_text(ended.time)} of the mission's clock"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return ", ".join(map(_value, value)) if isinstance(value, list) else str(value)


def _text(text: str) -> str:
    return escape(visible(text))


# A picture that is not as a journal has it is left out.
_BASE64 = re.compile(r"[A-Za-z0-9+/]+=*", re.ASCII)
# Symbols are this part of the longer edge.
_SYMBOL = 1 / 90
_MARGIN = 1 / 20
# Marks, which are some 24 wide, are this much of a symbol in each unit.
_MARK = 0.12
# The size of a label's letters in symbols, of a state's as a part of that, and the width of a letter as a part of its height.
_LETTER, _SAID, _WIDE = 2.2, 0.7, 0.62
# How far a label is from the middle of its mark, in symbols.
_BESIDE = 1.9
# To be cut off hides more than to lie on something: by this factor.
_OUTSIDE = 4
# A break of so many metres in the path is no way of a robot: it was carried, or the localisation has jumped.
_JUMP_M = 5.0
# A map that is turned by less is drawn as if it were not.
_TURNED_RAD = 1e-3

# As SVG around the origin, as large as a mark.
_AREA, _WAY = '<path class="{}" d="M-13 0 H13"/>', '<path class="trail" d="M-13 0 H13"/>'


def legend(state: MissionState) -> Iterator[tuple[str, str]]:
    """Yield each kind of symbol on the map once: its drawing, in units of a symbol around the origin, and its words."""
    drawn = {(_symbol(state, each), _words(state, each)): None for each in state.situation.landmarks.values()}
    yield from drawn
    if len(state.trail) > 1:
        yield _WAY, "way of the robot"


def _symbol(state: MissionState, landmark: Landmark) -> str:
    """Return the mark of a landmark as SVG around the origin; of an area, a part of its line."""
    kind, level = state.situation.kind_of(landmark), _level(state, landmark)
    if landmark.corners:
        return _AREA.format(f"area {level}")
    told = sign_of(landmark.level, is_found=kind.is_found)
    text = f'<text class="sign" y="5">{told}</text>' if told else ""
    return f'<g class="mark {level}"><path d="{MARKS.get(kind.shape, MARKS["circle"])}"/>{text}</g>'


def _words(state: MissionState, landmark: Landmark) -> str:
    kind = state.situation.kind_of(landmark)
    return visible(f"{kind.name}, {landmark.state}" if landmark.state else kind.name)


class MapBox(NamedTuple):
    """A part of the map, metres."""

    left: float
    low: float
    right: float
    high: float


def _courses(state: MissionState) -> Iterator[str]:
    """Yield a plot of each figure in percent that has risen or fallen: over the wall's time, from 0 to 100 %."""
    for name, course in state.courses.items():
        if len({value for _, value in course}) > 1:
            yield f'<h2>{_text(name[:1].upper() + name[1:])}</h2><div class="scroll">{_plot(state, name, course)}</div>'


def _plot(state: MissionState, name: str, course: Sequence[tuple[EventTime, float]]) -> str:
    began, (width, height, left, low) = course[0][0].wall, _PLOT
    whole = max(state.now.wall - began, 1e-9)

    def at(wall: float, value: float) -> str:
        return f"{left + width * (wall - began) / whole:.1f},{5 + height * (1 - min(max(value, 0), 100) / 100):.1f}"

    # What it was holds until it is something else.
    ends = [*(moment.wall for moment, _ in course[1:]), state.now.wall]
    steps = [
        at(wall, value)
        for (moment, value), end in zip(course, ends, strict=True)
        for wall in (moment.wall, end)
    ]
    lines = [
        f'<polyline class="axis" points="{at(began, share)} {at(began + whole, share)}"/>'
        for share in _SHARES
    ]
    marks = [
        f'<text text-anchor="end" x="{left - 6}" y="{9 + height * (1 - share / 100):.0f}">{share} %</text>'
        for share in _SHARES
    ]
    times = [
        f'<text x="{left}" y="{height + low - 8}">{_day(course[0][0], _CLOCK)}</text>',
        f'<text text-anchor="end" x="{left + width}" y="{height + low - 8}">{_day(state.now, _CLOCK)}</text>',
    ]
    label = escape(visible(f"{name}: {course[0][1]:g} % at first, {course[-1][1]:g} % at last"))
    return (
        f'<svg class="course" viewBox="0 0 {left + width + 5} {height + low}" role="img" aria-label="{label}">'
        f'{"".join((*lines, *marks, *times))}<polyline class="course" points="{" ".join(steps)}"/></svg>'
    )


def report_map(state: MissionState) -> str:
    """Return the map as an SVG element; empty if no position is known."""
    extent = _extent(state)
    if extent is None:
        return ""
    left, low, right, high = extent
    size = max(right - left, high - low) * _SYMBOL
    areas = (each for each in state.situation.landmarks.values() if each.corners)
    parts = [
        *_image(state),
        *_grid(extent, size),
        *(
            f'<polygon class="area {_level(state, each)}" points="{_points(each.corners)}"/>'
            for each in areas
        ),
        *(
            f'<polyline class="trail" points="{_points((pose.x, pose.y) for pose in way)}"/>'
            for way in _ways(state.trail)
        ),
        *_places(state, extent, size),
    ]
    box = f"{left:.3f} {-high:.3f} {right - left:.3f} {high - low:.3f}"
    plurals = ", ".join(kind.plural for kind in state.situation.kinds.values())
    label = escape(visible(f"Map: the way of the robot{', ' if plurals else ''}{plurals}"))
    return (
        f'<svg class="map" viewBox="{box}" role="img" aria-label="{label}" '
        f'style="stroke-width:{size / 4:.4f};font-size:{size * _LETTER:.4f}px">{"".join(parts)}</svg>'
    )


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
    # So far away that the numbers have no metres is nowhere.
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


def _image(state: MissionState) -> Iterator[str]:
    corners, png = _map_corners(state), str(state.map.get("png"))
    if corners and _BASE64.fullmatch(png):
        (left, low), (right, high) = corners
        yield (
            f'<image x="{left:g}" y="{-high:g}" width="{right - left:g}" height="{high - low:g}" '
            f'preserveAspectRatio="none" href="data:image/png;base64,{png}"/>'
        )


def _grid(extent: MapBox, size: float) -> Iterator[str]:
    """Yield lines in the distance of a round number of metres, which is said in a corner."""
    left, low, right, high = extent
    step = 10.0 ** math.floor(math.log10(max(right - left, high - low)))
    if max(right - left, high - low) / step < 3:  # noqa: PLR2004 - so that there are some
        step /= 5.0
    for x in _multiples(left, right, step):
        yield f'<line class="grid" x1="{x:g}" y1="{-high:.3f}" x2="{x:g}" y2="{-low:.3f}"/>'
    for y in _multiples(low, high, step):
        yield f'<line class="grid" x1="{left:.3f}" y1="{-y:g}" x2="{right:.3f}" y2="{-y:g}"/>'
    yield f'<text class="label scale" x="{left + size:.3f}" y="{-low - size:.3f}">grid {step:g} m</text>'


def _multiples(first: float, last: float, step: float) -> Iterable[float]:
    return (number * step for number in range(math.ceil(first / step), math.floor(last / step) + 1))


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


def _places(state: MissionState, extent: MapBox, size: float) -> Iterator[str]:
    places = [each for each in state.situation.landmarks.values() if not each.corners]
    for each in places:
        yield f'<g transform="translate({each.x:.3f} {-each.y:.3f}) scale({size * _MARK:.5f})">{_symbol(state, each)}</g>'
    taken = [_around(each.x, each.y, 1.5 * size, 1.5 * size) for each in places]
    for each in places:
        found = state.situation.kind_of(each).is_found
        said = each.state if not found and each.level != Level.DONE else ""
        label = _label(each, said, size, taken, extent)
        taken.append(label.box)
        yield label.line(each.name, "name" if found else "", 0.8 * _LETTER * size)
        if said:
            yield label.line(said, "said", 1.6 * _LETTER * size)


class _Label(NamedTuple):
    """The place of a label: its box, and where along x its lines are held (metres), by which of their ends."""

    box: MapBox
    x: float
    anchor: str

    def line(self, text: str, kind: str, down: float) -> str:
        """Return a line of it as SVG, so far below its upper edge, metres."""
        at = f'text-anchor="{self.anchor}" x="{self.x:.3f}" y="{down - self.box.high:.3f}"'
        return f'<text class="label {kind}" {at}>{escape(visible(text))}</text>'


def _label(landmark: Landmark, said: str, size: float, taken: Sequence[MapBox], extent: MapBox) -> _Label:
    """Return where the label of a landmark hides least: on the right of it, the left, below or above.

    Args:
        landmark: The landmark.
        said: What stands below its name.
        size: A symbol, metres.
        taken: What must not be hidden.
        extent: What is in sight.
    """
    x, y, away = landmark.x, landmark.y, _BESIDE * size
    wide = max(len(landmark.name), len(said) * _SAID) * _WIDE * _LETTER * size / 2
    high = (1.0 + (_SAID if said else 0.0)) * _LETTER * size / 2
    sides = (
        _Label(_around(x + away + wide, y, wide, high), x + away, "start"),
        _Label(_around(x - away - wide, y, wide, high), x - away, "end"),
        _Label(_around(x, y - away - high, wide, high), x, "middle"),
        _Label(_around(x, y + away + high, wide, high), x, "middle"),
    )

    def hidden(label: _Label) -> float:
        outside = 4 * wide * high - _overlap(label.box, extent)
        return _OUTSIDE * outside + sum(_overlap(label.box, each) for each in taken)

    return min(sides, key=hidden)


def _around(x: float, y: float, wide: float, high: float) -> MapBox:
    return MapBox(x - wide, y - high, x + wide, y + high)


def _overlap(one: MapBox, other: MapBox) -> float:
    """Return how much two boxes share, square metres."""
    width = min(one.right, other.right) - max(one.left, other.left)
    height = min(one.high, other.high) - max(one.low, other.low)
    return max(0.0, width) * max(0.0, height)


def _points(places: Iterable[tuple[float, float]]) -> str:
    return " ".join(f"{x:.3f},{-y:.3f}" for x, y in places)
