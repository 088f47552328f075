"""Computes the state of a mission from its journal, for the page, the reports and the terminal.

The state is the same whether the entries arrive one by one during the mission (`Journal.add_listener`) or from a file
(`JournalFile.stream`). An entry of an unknown kind, or whose data do not fit its kind, is treated as an event of the mission.
"""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

from sar_compiler.journal import journal_entries as events
from sar_compiler.journal.display import (
    AwaitedItem,
    DisplayState,
    EventTime,
    Gauge,
    Level,
    MissionPhase,
    default_sentence,
    position,
    with_author,
)
from sar_compiler.journal.georeference import Georeference
from sar_compiler.journal.journal_entries import CommandAuthor, JournalEntry

RUNNING, SUCCESS, FAILURE, HALTED, IDLE = "RUNNING", "SUCCESS", "FAILURE", "HALTED", "IDLE"
_INACTIVE = ("", IDLE, HALTED)
_WARN = 30
_PHASE_KINDS = (
    events.RUN_BEGAN,
    events.RUN_ENDED,
    events.GOAL_ENDED,
    events.CHANGED,
    events.PROGRESS,
    events.LACKS,
    events.BREAKPOINT,
)


class RunProcess(NamedTuple):
    """The state of the process that runs a mission. The entries of the journal do not contain this state.

    Attributes:
        is_gone: Whether the process no longer exists.
        silent_sec: The time since the process last wrote an entry, in seconds.
    """

    is_gone: bool = False
    silent_sec: float = 0.0


class RobotPose(NamedTuple):
    """A pose of the robot at one time, in the frame `map`: x and y in metres, and yaw in radians."""

    at: EventTime
    x: float
    y: float
    yaw: float


class RemainingDrive(NamedTuple):
    """The part of the current drive that remains.

    Attributes:
        target: The destination.
        distance: The remaining distance, in metres.
        time_left: The remaining time as estimated by the navigation, in seconds; None if there is no estimate.
    """

    target: str
    distance: float
    time_left: float | None


class LogLine(NamedTuple):
    """A line of the log: the time, the text, the logger and the severity."""

    at: EventTime
    text: str
    by: str = ""
    level: int = 0


class KnownEvent(NamedTuple):
    """An event of the mission.

    Attributes:
        at: The time of writing.
        kind: The kind of the event, such as `photo_taken`.
        data: The data of the event, as JSON values.
        text: A sentence about the event.
        by: The author of the command that caused the event; empty if there is none.
    """

    at: EventTime
    kind: str
    data: Mapping[str, Any]
    text: str
    by: str = ""


class WatchedProperty(NamedTuple):
    """A property that is monitored during a run.

    Attributes:
        name: The name of the property.
        if_broken: The reaction to a violation: `tell`, `hold` or `abort`, as in the properties file.
        is_owed: Whether the property still requires an event.
        broken: The time of the violation; None if the property is not violated.
        event: The event that violated the property, such as `Drive aborted`; empty for the end of the run.
    """

    name: str
    if_broken: str = "tell"
    is_owed: bool = False
    broken: EventTime | None = None
    event: str = ""


def outcome_words(status: str, label: str | None) -> str:
    """Return a status and the label of the outcome as text, such as `FAILURE (aborted)`.

    Args:
        status: The status.
        label: The label of the outcome; empty if several labels are possible, None if the leaf declares no
            outcomes.
    """
    if label is None or not status:
        return status
    return f"{status} ({label or 'outcome not reported'})"


@dataclass
class NodeState:
    """A node of the tree, with its last recorded status.

    Attributes:
        number: The number of the node in pre-order, from 0.
        name: The name of the node.
        kind: The class of the node.
        file: The file that contains the node.
        line: The line of the node in the file.
        depth: The number of the node's ancestors.
        parent: The number of the parent; None for the root.
        children: The numbers of the children.
        attributes: The attributes, by name.
        outline: The complete description of the node in the journal.
        start: The start of the run, in seconds of the mission's clock.
        status: The last status in the entries; empty if the node was never ticked. IDLE and HALTED mean that the node is inactive.
        message: The message of the node; empty while the node is inactive.
        label: The label of a leaf's outcome; empty if several labels are possible, None if the leaf declares
            no outcomes.
        changed: The entry of the last status change; None if the node was never ticked.
        tick: The number of the tick of the last `status` entry.
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
    outline: Mapping[str, Any] = field(default_factory=dict)
    start: float = 0.0
    status: str = ""
    message: str = ""
    label: str | None = None
    changed: JournalEntry | None = None
    tick: int = 0

    @property
    def status_text(self) -> str:
        """The status, the label and the message of the node as text."""
        return f"{outcome_words(self.status, self.label)}{f', {self.message}' if self.message else ''}"

    @property
    def location(self) -> str:
        """The source location of the node as `file:line`, or an empty string if it is unknown."""
        return f"{self.file}:{self.line}" if self.file else ""

    @property
    def status_time(self) -> EventTime | None:
        """The time of the last status change, or None if the node was never ticked."""
        return None if self.changed is None else self.time_of(self.changed)

    def time_of(self, entry: JournalEntry) -> EventTime:
        """Return the time of an entry in the run, relative to the start of the run."""
        return EventTime(entry.run, entry.time - self.start, entry.wall)

    @property
    def has_part(self) -> bool:
        """Whether the node belongs to the current activation of its parent: it was ticked and not reset."""
        return self.status not in _INACTIVE


@dataclass
class RunState:
    """A run of the mission.

    Attributes:
        number: The number of the run, from 1.
        began: The time of the start.
        about: The description of the run.
        ended: The time of the end; None if the run still continues or has crashed.
        ending: The kind of end: `over`, `stopped` or `failed`; empty if *ended* is None.
        status: The exit status.
        reason: The reason for the end, as a sentence.
        head: The head of the journal's chain after the run, as hexadecimal digits; empty if there is none.
    """

    number: int
    began: EventTime
    about: Mapping[str, Any]
    ended: EventTime | None = None
    ending: str = ""
    status: int | None = None
    reason: str = ""
    head: str = ""


class MissionState:
    """The state of a mission after the entries that were applied so far.

    Attributes:
        about: The description of the mission, written by its first run.
        runs: The runs in the order of their starts.
        nodes: The nodes of the tree, in pre-order.
        situation: The display state of the mission.
        is_told: Whether the mission has reported a display state; otherwise only the mission's events are
            known.
        since: The time at which each alarm was raised, by the alarm's text.
        figure_history: The times and values of each figure in percent, by the figure's name.
        facts: The events and the operator's commands in order, except events about goals (see `goals`).
        pose: The last pose of the robot; None before the first pose.
        trail: All poses so far.
        plan: The planned path, as x and y in the frame `map`, metres.
        drive: The remaining part of the current drive; None if the robot does not drive to a target.
        lacks: The reason why the robot cannot drive, in words; empty if the robot can drive.
        breakpoint: The breakpoint that pauses the tree, in words; empty if there is none.
        battery: The charge of the battery, as reported by the robot; None before the first report.
        map: The map: `x` and `y` of its lower left corner and the edge `resolution` of a cell in metres, `width` and
            `height` in cells, and the image `png`; empty if there is none.
        warnings: The warnings and errors in the log.
        goals: The actions of the goals that may be active, by goal ID.
        tick: The number of the last tick with a status change.
        since_phase: The start of the current phase.
        finished: The times at which landmarks were finished or abandoned in the last run, by kind and name.
        process: The state of the process that runs the mission; by default, a process that exists and has
            just written an entry.
        awaited: The resources that the next run waits for; empty if no run is about to start.
        properties: The monitored properties of the last run, by name; empty if there are none.
        assumption_failed_at: The first time at which the last run contradicted an assumption of the
            verification; None if no assumption was contradicted.
        place: A georeference that replaces the georeference in the parameters; None to use the parameters.
    """

    def __init__(self) -> None:
        self.about: Mapping[str, Any] = {}
        self.process = RunProcess()
        self.awaited: Sequence[AwaitedItem] = ()
        self.place: Georeference | None = None
        self.runs: list[RunState] = []
        self.nodes: list[NodeState] = []
        self._starts: dict[int, float] = {}
        self.situation = DisplayState(self._starts)
        self.is_told = False
        self.since: dict[str, EventTime] = {}
        self.figure_history: dict[str, list[tuple[EventTime, float]]] = {}
        self.facts: list[KnownEvent] = []
        self.pose: RobotPose | None = None
        self.trail: list[RobotPose] = []
        self.plan: list[tuple[float, float]] = []
        self.drive: RemainingDrive | None = None
        self.lacks = self.breakpoint = ""
        self.is_position_lost = False
        self.battery: Gauge | None = None
        self.map: Mapping[str, Any] = {}
        self.warnings: list[LogLine] = []
        self.goals: dict[str, str] = {}
        # The goals that earlier runs have left behind.
        self._left_goals: set[str] = set()
        self.tick = 0
        self._entry = JournalEntry(0, 1, 0.0, 0.0, "", {})
        self._now: EventTime | None = None
        self.since_phase = self.now
        self.finished: dict[tuple[str, str], EventTime] = {}
        self.properties: dict[str, WatchedProperty] = {}
        self.assumption_failed_at: EventTime | None = None
        self._phase, self._drive_reported_at = "", 0.0
        # The reason for the phase according to the mission, and the author of the command that led to the phase.
        self._phase_cause = "", CommandAuthor()

    @classmethod
    def from_stream(cls, stream: Iterable[JournalEntry]) -> "MissionState":
        """Apply all entries of a stream, and return the resulting state of the mission."""
        state = cls()
        for entry in stream:
            state.apply(entry)
        return state

    def apply(self, entry: JournalEntry) -> None:
        """Apply an entry to the state."""
        kind = entry.kind
        if kind == events.RUN_BEGAN:
            self._starts[entry.run] = entry.time
        self._entry, self._now = entry, None
        handle = self._HANDLERS.get(kind)
        if handle is not None:
            try:
                handle(self, **entry.data)
            except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
                pass  # another program has written an entry of this kind with other data
            else:
                if kind in _PHASE_KINDS:
                    self._update_phase(is_new_run=kind == events.RUN_BEGAN)
                return
        # A kind without a handler belongs to the mission or to a newer version. The default sentence describes the entry.
        self._add_event(kind, entry.data)

    def take_status(self, entry: JournalEntry) -> NodeState:
        """Apply a `status` entry that has valid data, and return the state of the node in this entry."""
        self._entry, self._now = entry, None
        data = entry.data
        state: NodeState = self.nodes[data["node"]]
        status, tick = data["status"], data["tick"]
        if state.status != status:
            state.status, state.changed = status, entry
        state.message, state.tick = "" if status in _INACTIVE else data["message"], tick
        state.label = data.get("label")
        self.tick = max(self.tick, tick)
        return state

    def adopt_statuses(self, other: "MissionState") -> None:
        """Replace the states of all nodes by those in *other*, which must be a `MissionState` of the same run."""
        self.nodes, self.tick = other.nodes, other.tick
        last = other._entry  # noqa: SLF001 - an attribute of this class
        if (self._entry.run, self._entry.number) < (last.run, last.number):
            self._entry, self._now = last, None

    @property
    def now(self) -> EventTime:
        """The time of the last entry."""
        if self._now is None:
            _, run, wall, time_, *_ = self._entry
            # A run can write log lines before it begins.
            self._now = EventTime(run, time_ - self._starts.get(run, time_), wall)
        return self._now

    def _add_event(self, kind: str, data: Mapping[str, Any]) -> None:
        self.facts.append(KnownEvent(self.now, kind, data, default_sentence(kind, data)))

    def _update_phase(self, *, is_new_run: bool) -> None:
        name = self.phase.name
        if is_new_run or name != self._phase:
            self._phase, self.since_phase = name, self.now

    def update_process(self, *, is_gone: bool) -> None:
        """Update the state of the process: set whether it is gone, and compute the time since its last entry."""
        self.process = RunProcess(is_gone, max(0.0, time.time() - self.now.wall))

    @property
    def title(self) -> str:
        """The name of the mission. For a run without a mission, the name of the tree's root."""
        return str(self.about.get("mission") or (self.nodes[0].name if self.nodes else "mission"))

    @property
    def robot(self) -> str:
        """The robot's name in a team, which is the namespace of the mission's ROS node, such as `robot1`.

        May be empty.
        """
        node = str(self.runs[-1].about.get("node") or "") if self.runs else ""
        return node.rpartition("/")[0].strip("/")

    @property
    def phase(self) -> MissionPhase:
        """The phase of an active run.

        It depends on breakpoints, the mission, missing requirements and the robot.
        """
        reported = self.situation.phase
        reported = reported._replace(reason=self.order or reported.reason)
        if self.breakpoint:
            return reported._replace(name="waiting", reason=self.breakpoint)
        if reported.name:
            return reported
        if self.is_position_lost:
            return reported._replace(name="position lost", reason="the robot does not know where it is")
        if self.lacks:
            return reported._replace(name="waiting", reason=self.lacks)
        return reported._replace(name="working" if self.drive is None else "driving")

    @property
    def order(self) -> str:
        """The reason for the phase and the author of the command that caused it, or "" if either is unknown."""
        reason, author = self._phase_cause
        return with_author(reason, author) if author.name and reason else ""

    @property
    def gauges(self) -> list[Gauge]:
        """The gauges of the mission.

        The robot's battery comes first if the mission has no gauge with this name.
        """
        reported = self.situation.gauges
        own = [self.battery] if self.battery is not None and self.battery.name not in reported else []
        return [*own, *reported.values()]

    def word_of(self, watched: WatchedProperty) -> str:
        """Return the state of a property as one word.

        The words are `broken` (violated), `owed` (still requires an event), `watched` (not violated so far)
        and, after the run, `kept` (not violated).
        """
        if watched.broken is not None:
            return "broken"
        if watched.is_owed:
            return "owed"
        return "kept" if self.runs and self.runs[-1].ended else "watched"

    @property
    def likely_end(self) -> float | None:
        """The estimated end of the mission, in seconds since the start of the run, or None if it is unknown.

        The estimate uses the current drive and the mean duration of the visits so far.
        """
        places = [each for each in self.situation.landmarks.values() if not each.corners]
        to_come = sum(
            each.level < Level.DONE and not self.situation.kind_of(each).is_found for each in places
        )
        if not self.finished or not to_come:
            return None
        last = max(each.time for each in self.finished.values())
        mean = last / len(self.finished)
        arrival = self._drive_reported_at + (self.drive.time_left or 0.0) if self.drive else 0.0
        return max(last + mean, arrival) + mean * (to_come - 1)

    @property
    def time_limit_sec(self) -> float | None:
        """The time limit of the run in seconds, or None if there is no limit."""
        limit = self.parameters.get("time_limit_sec")
        return float(limit) if isinstance(limit, int | float) and limit > 0 else None

    @property
    def head(self) -> str:
        """The head of the journal's hash chain in hexadecimal, or an empty string if the last run has none."""
        return self.runs[-1].head if self.runs else ""

    @property
    def parameters(self) -> Mapping[str, Any]:
        """The parameters of the last run, by name."""
        parameters = self.runs[-1].about.get("parameters") if self.runs else None
        return parameters if isinstance(parameters, Mapping) else {}

    def _on_run_began(self, run: Mapping[str, Any], **about: Any) -> None:
        self.runs.append(RunState(self.now.run, self.now, run))
        self._left_goals = {*self.goals}
        self.drive, self.plan, self.tick, self.lacks, self.breakpoint = None, [], 0, "", ""
        self.is_position_lost, self.awaited = False, ()
        self.finished, self.properties, self.assumption_failed_at = {}, {}, None
        self.about = self.about or about
        self.nodes = list(tree_nodes(self.about.get("tree")))
        for node in self.nodes:
            node.start = self._starts[self.now.run]

    def _on_run_ended(self, ending: str, status: int | None, reason: str, head: str = "") -> None:
        run = self.runs[-1]
        run.ended, run.ending, run.status, run.reason = self.now, str(ending), status, str(reason)
        run.head = str(head)
        self.drive, self.lacks, self.is_position_lost = None, "", False

    def _on_goal_sent(self, action: str, goal: str) -> None:
        # A run cancels the goals that an earlier run has left behind, before it sends a goal to the same action.
        for each in self._left_goals:
            if self.goals.get(each) == action:
                del self.goals[each]
        self.goals[goal] = action

    def _on_goal_ended(self, goal: str, status: int) -> None:  # noqa: ARG002 - the names of the entry's data
        self.goals.pop(goal, None)
        self.drive, self.plan = None, []

    def _on_status(self, node: int, tick: int, status: str, message: str, **_more: object) -> None:  # noqa: ARG002 - requires these data
        self.take_status(self._entry)

    def _on_pose(self, x: float, y: float, yaw: float) -> None:
        self.pose = RobotPose(self.now, *position(x, y), float(yaw))
        self.trail.append(self.pose)

    def _on_plan(self, frame: str, points: Any) -> None:
        self.plan = [position(*point) for point in points] if frame == "map" else []

    def _on_progress(self, target: str, distance: float, time_left: float | None) -> None:
        self._drive_reported_at = self.now.time
        self.drive = RemainingDrive(
            str(target), float(distance), None if time_left is None else float(time_left)
        )

    def _on_lacks(self, text: str, *, is_position_lost: bool = False) -> None:
        self.lacks, self.is_position_lost = str(text), bool(is_position_lost)

    def _on_breakpoint(self, text: str) -> None:
        self.breakpoint = str(text)

    def _on_battery(self, share: float, at_least: float | None = None) -> None:
        """Update the gauge that shows the robot's battery."""
        if not math.isfinite(share):
            raise ValueError(share)
        known = None if self.battery is None else self.battery.least
        least = known if at_least is None else round(100.0 * at_least)
        self.battery = Gauge("battery", round(100.0 * share), "%", least)

    def _on_map(self, **data: Any) -> None:
        self.map = data

    def _on_ordered(
        self, verb: str, label: str, by: str, refusal: str = "", reason: str = "", *, is_told: bool = False
    ) -> None:
        if not is_told:
            data = {"verb": verb, "label": label, "by": by, "reason": reason, "refusal": refusal}
            author = CommandAuthor(by or "an operator", reason)
            words = f"{with_author(label or verb, author)}{f': refused, {refusal}' if refusal else ''}"
            self.facts.append(KnownEvent(self.now, events.ORDERED, data, words, author.name))

    def _on_properties_watched(self, properties: Iterable[Mapping[str, Any]], **_more: object) -> None:
        watched = [WatchedProperty(str(each["name"]), str(each["if_broken"])) for each in properties]
        self.properties = {each.name: each for each in watched}

    def _on_properties_owed(self, owed: Iterable[str]) -> None:
        names = {*owed}
        self.properties = {
            name: each._replace(is_owed=name in names) for name, each in self.properties.items()
        }

    def _on_property_broken(self, **data: Any) -> None:
        name, event = str(data["property"]), str(data["event"])
        known = self.properties.get(name, WatchedProperty(name))
        self.properties[name] = known._replace(broken=known.broken or self.now, event=known.event or event)
        self._add_event(events.PROPERTY_BROKEN, data)

    def _on_assumption_failed(self, **data: Any) -> None:
        self.assumption_failed_at = self.assumption_failed_at or self.now
        self._add_event(events.ASSUMPTION_FAILED, data)

    def _on_leaf_raised(self, text: str, node: int | None = None) -> None:
        data = {"node": node, "text": text}
        self.facts.append(
            KnownEvent(self.now, events.LEAF_RAISED, data, f"an exception has ended the run: {text}")
        )

    def _on_log(self, node: str, level: int, text: str, stamp: float = 0.0) -> None:  # noqa: ARG002 - for the page
        if level >= _WARN:
            self.warnings.append(LogLine(self.now, str(text), str(node), int(level)))

    def _on_changed(
        self, said: str = "", kinds: Iterable[Mapping[str, Any]] | None = None, **data: Any
    ) -> None:
        situation = self.situation
        if kinds is not None:
            self.situation = situation = DisplayState(self._starts)
            situation.apply(kinds)
            self.is_told = True
        situation.apply(**data)
        if (reason := situation.phase.reason) != self._phase_cause[0]:
            self._phase_cause = reason, CommandAuthor.from_data(data)
        self._finish(data.get("landmarks", ()))
        self.since = {text: self.since.get(text, self.now) for text in situation.alarms}
        for name, value in (
            (each["name"], each["value"]) for each in data.get("figures", ()) if each.get("unit") == "%"
        ):
            if isinstance(value, int | float) and math.isfinite(value):
                self.figure_history.setdefault(name, []).append((self.now, value))
        if said and self.facts:
            author = CommandAuthor.from_data(data)
            self.facts[-1] = self.facts[-1]._replace(text=with_author(str(said), author), by=author.name)

    _HANDLERS: ClassVar[Mapping[str, Callable[..., None]]] = {
        events.RUN_BEGAN: _on_run_began,
        events.RUN_ENDED: _on_run_ended,
        events.GOAL_SENT: _on_goal_sent,
        events.GOAL_ENDED: _on_goal_ended,
        events.STATUS: _on_status,
        events.POSE: _on_pose,
        events.PLAN: _on_plan,
        events.PROGRESS: _on_progress,
        events.LACKS: _on_lacks,
        events.BREAKPOINT: _on_breakpoint,
        events.BATTERY: _on_battery,
        events.MAP: _on_map,
        events.ORDERED: _on_ordered,
        events.PROPERTIES_WATCHED: _on_properties_watched,
        events.PROPERTIES_OWED: _on_properties_owed,
        events.PROPERTY_BROKEN: _on_property_broken,
        events.ASSUMPTION_FAILED: _on_assumption_failed,
        events.LEAF_RAISED: _on_leaf_raised,
        events.LOG: _on_log,
        events.CHANGED: _on_changed,
    }

    def _finish(self, landmarks: Iterable[Mapping[str, Any]]) -> None:
        for kind, name in ((each["kind"], each["name"]) for each in landmarks):
            landmark = self.situation.landmarks[kind, name]
            # Landmarks that were finished before the run are reported at its start, at time 0.
            if (
                landmark.level >= Level.DONE
                and not self.situation.kind_of(landmark).is_found
                and self.now.time
            ):
                self.finished.setdefault((kind, name), self.now)


def tree_nodes(tree: Any) -> Iterator[NodeState]:
    """Yield the nodes of the tree that a journal describes, in pre-order. Ignore invalid nodes."""
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
            outline=node,
        )
        if parent is not None:
            parent.children.append(number)
        number += 1
        yield state
        if isinstance(children, list):
            waiting.extend((child, state) for child in reversed(children) if isinstance(child, Mapping))
