"""The state of a mission, folded from the entries of its journal: what a page, a report and a terminal show.

The entries come one by one while the mission runs (`Journal.listen`), or all at once from a file (`JournalFile.stream`);
the state is the same. Entries of other kinds, or without what belongs to their kind, are kept as they are: they are the mission's own.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from sar_compiler.journal.journal_entries import GOAL_ENDED, GOAL_SENT, RUN_BEGAN, RUN_ENDED, JournalEntry

RUNNING, SUCCESS, FAILURE = "RUNNING", "SUCCESS", "FAILURE"
_RESTING = ("IDLE", "HALTED")
_WARN = 30


class Instant(NamedTuple):
    """When something was.

    Attributes:
        run: The number of the run, from 1.
        time: Seconds of the mission's clock since the run's beginning.
        wall: Seconds since 1970.
    """

    run: int
    time: float
    wall: float


class Position(NamedTuple):
    """A position in the frame `map`, metres."""

    x: float
    y: float


class RobotPose(NamedTuple):
    """Where the robot was: the moment, x and y in metres and yaw in radians, frame `map`."""

    at: Instant
    x: float
    y: float
    yaw: float


class DriveLeft(NamedTuple):
    """What is left of a drive.

    Attributes:
        target: Where to.
        distance: Metres.
        time_left: Seconds, as the navigation estimates them; None if it does not.
    """

    target: str
    distance: float
    time_left: float | None


class Told(NamedTuple):
    """What was said at a moment, by whom."""

    at: Instant
    text: str
    by: str = ""
    level: int = 0


class Noted(NamedTuple):
    """An entry that means something to the mission alone.

    Attributes:
        at: When it was written.
        kind: What it is, such as `photo_taken`.
        data: What belongs to it, as JSON values.
    """

    at: Instant
    kind: str
    data: Mapping[str, Any]


@dataclass
class NodeState:
    """A node of the tree.

    Attributes:
        number: Its number in pre-order, from 0.
        name: Its name.
        kind: Its class.
        file: The file that it is written in.
        line: The line there.
        depth: The number of its ancestors.
        parent: The number of its parent; None for the root.
        children: The numbers of its children.
        attributes: Its attributes, by name.
        status: As in the entries; empty if it was never ticked. IDLE and HALTED: it has no part in what is going on.
        message: What it says; empty while it has no part in what is going on.
        since: The moment of its last change of status.
        tick: The number of the tick in which it has changed last.
    """

    number: int
    name: str
    kind: str
    file: str
    line: int
    depth: int
    parent: int | None
    children: list[int] = field(default_factory=list)
    attributes: Mapping[str, Any] = field(default_factory=dict)
    status: str = ""
    message: str = ""
    since: Instant | None = None
    tick: int = 0

    @property
    def has_part(self) -> bool:
        """Whether its status is one of the present activation of its parent."""
        return self.status not in ("", *_RESTING)


@dataclass
class ZoneState:
    """A zone.

    Attributes:
        name: Its name.
        place: Where it is; None if that is not known.
        state: `open`, `under way`, `searched`, `visited` or `abandoned`.
        reason: Why it was given up untried, in words.
        attempts: How often it was set out for.
        started: When it was set out for last.
        searched: When a search of it was finished; None if none was, whatever the state is.
        left: When it was visited or abandoned.
        unplaced: Why somebody whom its last search has found cannot be where that says, in words; empty if there is nobody.
    """

    name: str
    place: Position | None = None
    state: str = "open"
    reason: str = ""
    attempts: int = 0
    started: Instant | None = None
    searched: Instant | None = None
    left: Instant | None = None
    unplaced: str = ""

    @property
    def said(self) -> str:
        """Whether it was searched, in words: a robot may have been there, and nobody has looked."""
        searched = "searched" if self.searched is not None else "not searched"
        if self.state == "abandoned":
            return f"{searched}, given up"
        return f"visited, {searched}" if self.state == "visited" and self.searched is None else searched


@dataclass
class SurvivorState:
    """A survivor.

    Attributes:
        place: The position.
        zone: The zone; empty if unknown.
        name: The name; empty before there is one.
        standing: What the operator says: `candidate`, `confirmed`, `rejected` or `merged`.
        possibly: The name of somebody found before, who may be the same, or is it, if merged; else empty.
        report: `not sent`, `sent`, `kept` or `acknowledged`.
        found: When it was found.
        sent: When the report was sent last.
        acknowledged: When base has acknowledged the report.
    """

    place: Position
    zone: str = ""
    name: str = ""
    standing: str = "candidate"
    possibly: str = ""
    report: str = "not sent"
    found: Instant | None = None
    sent: Instant | None = None
    acknowledged: Instant | None = None


@dataclass
class RunState:
    """A run of the mission.

    Attributes:
        number: From 1.
        began: When.
        about: What it ran with.
        ended: When it ended; None if it still runs, or broke off.
        ending: How: `over`, `stopped` or `failed`; empty if it has not.
        status: The exit status.
        reason: The reason in a sentence.
    """

    number: int
    began: Instant
    about: Mapping[str, Any]
    ended: Instant | None = None
    ending: str = ""
    status: int | None = None
    reason: str = ""


class MissionState:
    """What is known of a mission after some of its entries.

    Attributes:
        about: What the mission is, as its first run has said.
        runs: Its runs, the latest last.
        nodes: The nodes of the tree, in pre-order.
        zones: The zones by name, in the order of the plan.
        zone: The zone that is under way; empty if none is.
        survivors: The survivors, in the order in which they were found.
        base: The base station.
        home: Whether the robot is there.
        held: Whether the operator has paused the mission.
        pose: Where the robot was last; None before anything is known of it.
        trail: Where it has been.
        plan: The way that it is about to drive, as points in the frame `map`.
        drive: What is left of the drive that is under way; None if none is.
        map: The map: `x` and `y` of its lower left corner and the edge `resolution` of a cell in metres, `width` and
            `height` in cells, and the image `png`; empty if there is none.
        alarms: Reasons to cut the mission short.
        orders: What the operator has ordered.
        warnings: Warnings and errors of the log.
        noted: What the mission has written of its own, in its order.
        goals: The goals that may be active: their actions, by id.
        tick: The number of the last tick in which anything has changed.
        now: The moment of the last entry.
    """

    def __init__(self) -> None:
        self.about: Mapping[str, Any] = {}
        self.runs: list[RunState] = []
        self.nodes: list[NodeState] = []
        self.zones: dict[str, ZoneState] = {}
        self.zone = ""
        self.survivors: list[SurvivorState] = []
        self.base: Position | None = None
        self.home = self.held = False
        self.pose: RobotPose | None = None
        self.trail: list[RobotPose] = []
        self.plan: list[Position] = []
        self.drive: DriveLeft | None = None
        self.map: Mapping[str, Any] = {}
        self.alarms: list[Told] = []
        self.orders: list[Told] = []
        self.warnings: list[Told] = []
        self.noted: list[Noted] = []
        self.goals: dict[str, str] = {}
        self.tick = 0
        self.now = Instant(1, 0.0, 0.0)
        self._start = 0.0
        self._kinds: Mapping[str, Callable[..., object]] = {
            RUN_BEGAN: self._run_began,
            RUN_ENDED: self._run_ended,
            GOAL_SENT: self._goal_sent,
            GOAL_ENDED: self._goal_ended,
            "status": self._status,
            "pose": self._pose,
            "plan": self._plan,
            "progress": self._progress,
            "map": self._map,
            "log": self._log,
            "zone_added": self._zone_added,
            "zone_started": self._zone_started,
            "zone_searched": self._zone_searched,
            "survivor_unplaced": self._survivor_unplaced,
            "zone_visited": lambda zone: self._zone_left(zone, "visited"),
            "zone_postponed": lambda zone: self._zone_left(zone, "open"),
            "zone_abandoned": self._zone_abandoned,
            "survivor_named": self._survivor_named,
            "survivor_judged": self._survivor_judged,
            "report_sent": lambda survivor: self._reported(survivor, "sent", sent=self.now),
            "report_kept": lambda survivor: self._reported(survivor, "kept"),
            "report_acknowledged": lambda survivor: self._reported(
                survivor, "acknowledged", acknowledged=self.now
            ),
            "operator_ordered": self._operator_ordered,
            "alarmed": lambda reason: self.alarms.append(Told(self.now, str(reason))),
            "base_reached": self._base_reached,
        }

    @classmethod
    def of(cls, stream: Iterable[JournalEntry]) -> "MissionState":
        """Return the state of a mission after entries."""
        state = cls()
        for entry in stream:
            state.take(entry)
        return state

    def take(self, entry: JournalEntry) -> None:
        """Let an entry happen."""
        if entry.kind == RUN_BEGAN:
            self._start = entry.time
        self.now = Instant(entry.run, entry.time - self._start, entry.wall)
        happen = self._kinds.get(entry.kind)
        if happen is not None:
            try:
                happen(**entry.data)
            except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
                pass  # somebody else's entry of that kind
            else:
                return
        self.noted.append(Noted(self.now, entry.kind, entry.data))

    @property
    def title(self) -> str:
        """What it is called: the mission, or the root of the tree."""
        return str(self.about.get("mission") or (self.nodes[0].name if self.nodes else "mission"))

    @property
    def parameters(self) -> Mapping[str, Any]:
        """The parameters of the last run, by name."""
        given = self.runs[-1].about.get("parameters") if self.runs else None
        return given if isinstance(given, Mapping) else {}

    @property
    def fence(self) -> list[Position]:
        """The corners of the geofence; empty for none."""
        numbers = self.parameters.get("geofence")
        if not isinstance(numbers, Sequence):
            return []
        try:
            return [_position(x, y) for x, y in zip(numbers[::2], numbers[1::2], strict=False)]
        except (ArithmeticError, TypeError, ValueError):
            return []

    def survivor(self, name: str) -> SurvivorState | None:
        """Return a survivor by the name; None if nobody has it."""
        return next((each for each in self.survivors if each.name == name), None)

    def _run_began(self, run: Mapping[str, Any], **about: Any) -> None:
        self.runs.append(RunState(self.now.run, self.now, run))
        self.drive, self.plan, self.tick = None, [], 0
        self._leave_off()
        if not self.about:
            self.about = about
            self._take_identity(about.get("identity") or {})
        self.nodes = list(tree_nodes(self.about.get("tree")))

    def _take_identity(self, identity: Mapping[str, Any]) -> None:
        for zone in identity.get("zones") or []:
            self.zones[str(zone["id"])] = ZoneState(str(zone["id"]), _position(zone["x"], zone["y"]))
        base = identity.get("base_station")
        self.base = _position(base["x"], base["y"]) if base else None

    def _run_ended(self, ending: str, status: int | None, reason: str) -> None:
        run = self.runs[-1]
        run.ended, run.ending, run.status, run.reason = self.now, str(ending), status, str(reason)
        self._leave_off()

    def _leave_off(self) -> None:
        """Have no zone under way, because the run has ended, or another zone is."""
        for zone in self.zones.values():
            if zone.state in ("under way", "searched"):
                zone.state = "open"
        self.zone = ""

    def _goal_sent(self, action: str, goal: str) -> None:
        self.goals[goal] = action

    def _goal_ended(self, goal: str, status: int) -> None:  # noqa: ARG002 - as the entry has it
        self.goals.pop(goal, None)
        self.drive, self.plan = None, []

    def _status(self, node: int, tick: int, status: str, message: str, **_last: object) -> None:
        state = self.nodes[node]
        if state.status != status:
            state.status, state.since = str(status), self.now
        state.message, state.tick = str(message) if state.has_part else "", int(tick)
        self.tick = max(self.tick, int(tick))

    def _pose(self, x: float, y: float, yaw: float) -> None:
        self.pose = RobotPose(self.now, *_position(x, y), float(yaw))
        self.trail.append(self.pose)

    def _plan(self, frame: str, points: Any) -> None:
        self.plan = [_position(*point) for point in points] if frame == "map" else []

    def _progress(self, target: str, distance: float, time_left: float | None) -> None:
        self.drive = DriveLeft(str(target), float(distance), None if time_left is None else float(time_left))

    def _map(self, **data: Any) -> None:
        self.map = data

    def _log(self, node: str, level: int, text: str) -> None:
        if level >= _WARN:
            self.warnings.append(Told(self.now, str(text), str(node), int(level)))

    def _zone(self, name: str) -> ZoneState:
        return self.zones.setdefault(str(name), ZoneState(str(name)))

    def _zone_added(self, id: str, x: float, y: float, yaw: float) -> None:  # noqa: A002, ARG002 - as a zone has it
        self.zones[str(id)] = ZoneState(str(id), _position(x, y))

    def _zone_started(self, zone: str) -> None:
        self._leave_off()
        state = self._zone(zone)
        state.state, state.started, state.attempts = "under way", self.now, state.attempts + 1
        self.zone, self.home = state.name, False

    def _zone_searched(self, zone: str, survivor: Any) -> None:
        state = self._zone(zone)
        state.state, state.searched, state.unplaced = "searched", self.now, ""
        if survivor is None:
            return
        found = SurvivorState(_position(*survivor), str(zone), found=self.now)
        if not any((each.zone, each.place) == (found.zone, found.place) for each in self.survivors):
            self.survivors.append(found)

    def _survivor_unplaced(self, zone: str, reason: str) -> None:
        self._zone(zone).unplaced = str(reason)

    def _zone_left(self, zone: str, end: str) -> None:
        state = self._zone(zone)
        state.state, state.left = end, self.now
        self.zone, self.drive = "", None
        if end == "open":
            self.zones[state.name] = self.zones.pop(state.name)

    def _zone_abandoned(self, zone: str, attempts: int, reason: str) -> None:
        state = self._zone(zone)
        state.reason = str(reason) or f"it was not reached in {attempts} attempts"
        self._zone_left(zone, "abandoned")

    def _survivor_named(self, survivor: str, x: float, y: float, possibly: str | None = None) -> None:
        place = _position(x, y)
        named = next((each for each in reversed(self.survivors) if each.place == place), None)
        if named is None:
            named = SurvivorState(place, found=self.now)
            self.survivors.append(named)
        named.name, named.possibly = str(survivor), str(possibly or "")

    def _survivor_judged(self, survivor: str, standing: str, same_as: str | None) -> None:
        judged = self.survivor(survivor)
        if judged is not None:
            judged.standing, judged.possibly = str(standing), str(same_as or judged.possibly)
            self.orders.append(
                Told(self.now, f"{survivor} is {standing}{f' with {same_as}' if same_as else ''}")
            )

    def _reported(self, survivor: str, report: str, **instants: Instant) -> None:
        state = self.survivor(survivor)
        if state is not None:
            state.report = report
            vars(state).update(instants)

    def _operator_ordered(self, order: str) -> None:
        self.held = {"hold": True, "release": False}.get(order, self.held)
        self.orders.append(Told(self.now, str(order)))

    def _base_reached(self) -> None:
        self.home, self.zone, self.drive = True, "", None


def _position(x: Any, y: Any) -> Position:
    place = Position(float(x), float(y))
    if not (math.isfinite(place.x) and math.isfinite(place.y)):
        message = f"({x}, {y}) is no position"
        raise ValueError(message)
    return place


def tree_nodes(tree: Any) -> Iterator[NodeState]:
    """Yield the nodes of a tree as the journal has it, in pre-order; what is none is left out."""
    waiting: list[tuple[Any, NodeState | None]] = [(tree, None)] if isinstance(tree, Mapping) else []
    number = 0
    while waiting:
        node, parent = waiting.pop()
        line, children = node.get("line"), node.get("children")
        state = NodeState(
            number,
            str(node.get("name")),
            str(node.get("class")),
            str(node.get("file") or ""),
            line if isinstance(line, int) else 0,
            0 if parent is None else parent.depth + 1,
            None if parent is None else parent.number,
            attributes=node.get("attributes") or {},
        )
        if parent is not None:
            parent.children.append(number)
        number += 1
        yield state
        if isinstance(children, list):
            waiting.extend((child, state) for child in reversed(children) if isinstance(child, Mapping))
