"""The state of one robot's mission that a page shows, and the changes to send, as JSON values."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

from sar_compiler.journal import journal_entries as events
from sar_compiler.journal.command_objects import run_identity
from sar_compiler.journal.display import AwaitedItem, EventTime, Landmark, with_author
from sar_compiler.journal.georeference import Georeference
from sar_compiler.journal.journal_entries import CommandAuthor, JournalEntry
from sar_compiler.journal.mission_state import (
    FAILURE,
    HALTED,
    IDLE,
    RUNNING,
    SUCCESS,
    MissionState,
    RunProcess,
)
from sar_compiler.journal.open_tasks import find_open_tasks
from sar_compiler.journal.resume_command import resume_command
from sar_compiler.journal.status_line import condition

_LEVELS = {30: "warning", 40: "error", 50: "error"}
# The maximum number of log lines. A longer log is cut to the last lines (_RECENT), and earlier events and warnings (_IMPORTANT).
_LOG, _RECENT, _IMPORTANT = 2000, 300, 1400
# The maximum number of points of the trail. Every second point is removed from a longer trail.
_TRAIL = 1000
# The maximum number of status changes of leaves. A longer list is cut to the latest `_KEPT_LANES` changes.
_LANES, _KEPT_LANES = 2000, 1200
# A late line of the ROS log is inserted by time, at most this number of lines before the end.
_LATE = 50

PageChange = dict[str, Any]
"""The changes of a page's state as JSON values, returned by `PageState.change`."""


class LastStatus(NamedTuple):
    """The last status of a node, ignoring resets, with statistics of earlier statuses. Times are seconds since the run's start.

    Attributes:
        status: The status in the last entry that is not a reset.
        since: The start of this status.
        entered: The tick in which the node's activation started.
        time: The time of the last change.
        tick: The tick of the last change.
        message: The message of the node.
        failed: The time of the last failure; None if there was none.
        failure: The message of the last failure.
        label: The label of the outcome; empty if the label is unknown.
        ends: The numbers of recorded ends with SUCCESS, FAILURE and HALTED. An end that is repeated in consecutive ticks is recorded once.
        ran: The total running time before these ends, in seconds.
        longest: The longest running time before an end, in seconds.
    """

    status: str = ""
    since: float = 0.0
    entered: int = 0
    time: float = 0.0
    tick: int = 0
    message: str = ""
    failed: float | None = None
    failure: str = ""
    label: str = ""
    ends: tuple[int, int, int] = (0, 0, 0)
    ran: float = 0.0
    longest: float = 0.0

    def with_status(
        self, status: str, message: str, label: str, tick: int, now: float, *, was_reset: bool
    ) -> "LastStatus":
        """Return a record that includes a further status. After a reset, the status starts a new activation."""
        is_same = self.status == status and not was_reset
        has_failed = status == FAILURE
        took = now - self.since if self.status == RUNNING and status != RUNNING else 0.0
        successes, failures, halts = self.ends
        return LastStatus(
            status,
            self.since if is_same else now,
            # An activation lasts while the node is running, and ends with the node's next status.
            self.entered if self.status == RUNNING else tick,
            now,
            tick,
            message,
            now if has_failed else self.failed,
            message if has_failed else self.failure,
            label,
            (successes + (status == SUCCESS), failures + has_failed, halts + (status == HALTED)),
            self.ran + took,
            max(self.longest, took),
        )


class GrowingList:
    """A list that reports the first index changed since the last report, and all values from this index on.

    Attributes:
        values: The content.
    """

    def __init__(self) -> None:
        self.values: list[Any] = []
        self._first_changed = 0

    def append(self, value: Any) -> None:
        """Append a value."""
        self.values.append(value)

    def insert(self, index: int, value: Any) -> None:
        """Insert a value at an index."""
        self.values.insert(index, value)
        self._first_changed = min(self._first_changed, index)

    def replace(self, index: int, value: Any) -> None:
        """Replace the value at an index."""
        self.values[index] = value
        self._first_changed = min(self._first_changed, index)

    def renew(self, values: list[Any]) -> None:
        """Replace the whole content."""
        self.values, self._first_changed = values, 0

    def pop_changes(self) -> dict[str, Any] | None:
        """Return the changes since the last call, or None if nothing has changed."""
        at, self._first_changed = self._first_changed, len(self.values)
        return {"at": at, "values": self.values[at:]} if at < len(self.values) else None


class PageState:
    """The state of a robot's mission that the page shows, after the entries applied so far.

    A change consists of the following parts. A change with `begin` replaces the whole state.
    - New values of `states` (by node), `landmarks` (by kind and name, null for a landmark that has disappeared) and `rasters` (by name).
    - New ends, from an index on, of `log`, `trail` and `lanes` (the status changes of leaves: time, node, status).
    - All other parts as a whole, such as `run`, `nodes`, `pose`, `condition`, `tasks`, `times` (of pose, plan and map), `figures` and `why`. The
      list is in `_READ`.

    Args:
        robot: The robot's index among the robots of the page.
        journal: The path of the robot's journal; empty if there is none.

    Attributes:
        robot: The robot's index among the robots of the page.
    """

    def __init__(self, robot: int = 0, journal: str = "") -> None:
        self.robot, self._journal = robot, journal
        self._passed = 0.0
        self._began = 0.0
        self._mission = MissionState()
        # The last status of each node, by the node's number, and the numbers of the nodes that were reset since then.
        self._last: dict[int, LastStatus] = {}
        self._reset_nodes: set[int] = set()
        # The cause of the run's failure, which another module determines.
        self._why: Mapping[str, Any] | None = None
        self._times: dict[str, float] = {}
        self._log, self._trail, self._lanes = GrowingList(), GrowingList(), GrowingList()
        # The times of the log's last lines, in seconds since 1970.
        self._walls: list[float] = []
        # Whether the log has a line about the end of the current run.
        self._has_ended = False
        # The index of the last event in the log; its sentence follows it.
        self._fact: int | None = None
        self.resend()

    def resend(self) -> None:
        """Make the next change include the whole state."""
        self._is_new = True
        self._touched: set[str] = set()
        self._nodes: set[int] = set()
        self._landmarks: dict[tuple[str, str], None] = {}
        self._gone: set[tuple[str, str]] = set()
        self._rasters: set[str] = set()

    def apply(self, entry: JournalEntry) -> None:
        """Apply an entry to the state.

        Raises:
            TypeError: If a value is not JSON.
        """
        mission = self._mission
        if entry.kind == events.RUN_BEGAN and mission.runs and entry.run <= mission.runs[-1].number:
            self.__init__(self.robot, self._journal)  # type: ignore[misc] # another mission has begun in the same journal
            mission = self._mission
        mission.apply(entry)
        self._touched.update(self._PARTS.get(entry.kind, ()))
        if mission.facts:
            self._fact = self._add_line("fact", mission.facts.pop().text)
        else:
            handle = self._HANDLERS.get(entry.kind)
            if handle is not None:  # entries of all other kinds only change the mission's state
                handle(self, entry)
            if entry.kind in self._TIMED:
                self._times[entry.kind] = mission.now.time
                self._touched.add("times")
        self._passed = 0.0
        self._touched.add("time")

    def let_pass(self, seconds: float) -> None:
        """Set the time to a number of seconds after the last entry."""
        self._passed = seconds
        self._touched.add("time")

    def set_why(self, why: Mapping[str, Any]) -> None:
        """Set the cause of the run's failure, as JSON values. The start of a new run removes the cause."""
        self._why = why
        self._touched.add("why")

    def set_awaited(self, items: Sequence[AwaitedItem]) -> None:
        """Set the resources that the next run waits for. They are removed when this run starts."""
        self._mission.awaited = items
        self._touched.update(("awaited", "condition", "tasks"))

    def set_process(self, process: RunProcess) -> None:
        """Update the state of the process that runs the mission."""
        before = condition(self._mission)
        self._mission.process = process
        if condition(self._mission) != before:
            self._touched.update(("condition", "tasks", "resume"))

    def change(self) -> PageChange | None:
        """Return the changes since the last call, or None if nothing has changed."""
        if self._is_new:
            change = self.full_state()
            for _, each in self._lists():
                each.pop_changes()
        elif self._touched:
            change = {"robot": self.robot, **{part: self._READ[part](self) for part in self._touched}}
            if self._nodes:
                change["states"] = {str(number): self._last[number] for number in self._nodes}
            if self._landmarks:
                change["landmarks"] = {"/".join(key): self._landmark(key) for key in self._landmarks}
            if self._rasters:
                change["rasters"] = {name: self._raster(name) for name in self._rasters}
            change.update({name: news for name, each in self._lists() if (news := each.pop_changes())})
        else:
            return None
        self.resend()
        self._is_new = False
        return change

    def full_state(self) -> PageChange:
        """Return the whole state in the form of changes to an empty state."""
        return {
            "begin": True,
            "robot": self.robot,
            **{part: read(self) for part, read in self._READ.items()},
            "states": {str(number): last for number, last in sorted(self._last.items()) if last.status},
            "landmarks": {"/".join(key): self._landmark(key) for key in self._mission.situation.landmarks},
            "rasters": {name: self._raster(name) for name in self._mission.situation.rasters},
            **{name: {"at": 0, "values": each.values[:]} for name, each in self._lists()},
        }

    def _lists(self) -> tuple[tuple[str, GrowingList], ...]:
        return ("log", self._log), ("trail", self._trail), ("lanes", self._lanes)

    def _on_run_began(self, entry: JournalEntry) -> None:
        self._began, self._times = entry.time, {}
        self._why, self._has_ended = None, False
        self._nodes = set()
        self._last, self._reset_nodes = {}, set()
        self._lanes.renew([])
        self._add_line("fact", "The run began.")

    def _on_run_ended(self, _: JournalEntry) -> None:
        run = self._mission.runs[-1]
        if self._has_ended:  # Nav2 publishes the last tick of a goal after it has reported the goal's end
            return
        self._has_ended = True
        self._add_line("fact", f"The run ended{f': {run.reason}' if run.reason else '.'}")

    def _on_status(self, entry: JournalEntry) -> None:
        data = entry.data
        number = data["node"]
        self._add_to_lane(number, str(data["status"]))
        if data["status"] == IDLE:  # the page shows the last status until the node is ticked again
            self._reset_nodes.add(number)
            return
        self._nodes.add(number)
        self._last[number] = self._last.get(number, LastStatus()).with_status(
            str(data["status"]),
            str(data["message"]),
            str(data.get("label") or ""),
            int(data["tick"]),
            self._mission.now.time,
            was_reset=number in self._reset_nodes,
        )
        self._reset_nodes.discard(number)

    def _add_to_lane(self, number: int, status: str) -> None:
        if self._mission.nodes[number].children:
            return
        self._lanes.append([round(self._mission.now.time, 2), number, status])
        if len(changes := self._lanes.values) > _LANES:
            self._lanes.renew(changes[-_KEPT_LANES:])

    def _on_pose(self, _: JournalEntry) -> None:
        for pose in self._mission.trail:
            self._trail.append([pose.x, pose.y])
        self._mission.trail.clear()
        if len(points := self._trail.values) > _TRAIL:
            self._trail.renew([*points[:-1:2], points[-1]])

    def _on_log(self, entry: JournalEntry) -> None:
        self._mission.warnings.clear()
        data = entry.data
        self._add_line(_LEVELS.get(data["level"], "info"), str(data["text"]), data.get("stamp"))

    def _on_changed(self, entry: JournalEntry) -> None:
        data = entry.data
        self._touched.update(data.keys() & self._SITUATION)
        keys = [(each["kind"], each["name"]) for each in data.get("landmarks", ())]
        self._gone.update((kind, name) for kind, name in data.get("gone", ()))
        self._landmarks.update(dict.fromkeys([*keys, *self._gone]))
        self._rasters.update(each["name"] for each in data.get("rasters", ()))
        if "kinds" in data or not self._gone.isdisjoint(keys):
            # Landmarks of an earlier run may have disappeared, or a landmark was replaced. The page then needs the whole state.
            self._is_new = True
        if self._fact is not None and (sentence := data.get("said")):
            *when, _ = self._log.values[self._fact]
            self._log.replace(self._fact, [*when, with_author(str(sentence), CommandAuthor.from_data(data))])

    def _add_line(self, level: str, text: str, stamp: float | None = None) -> int:
        """Add a line to the log, sorted by time if it has a time stamp; return the line's index."""
        now, lines, walls = self._mission.now, self._log.values, self._walls
        wall = now.wall if stamp is None else min(now.wall, stamp)
        of_run = sum(1 for line in lines[-len(walls) :] if line[0] == now.run) if walls else 0
        later = 0 if stamp is None else next((n for n in range(of_run) if walls[-1 - n] <= wall), of_run)
        index = len(lines) - later
        self._log.insert(index, [now.run, lines[index][1] if later else now.time, level, text])
        walls.insert(len(walls) - later, wall)
        del walls[:-_LATE]
        if self._fact is not None and index <= self._fact:
            self._fact += 1
        if len(lines) <= _LOG:
            return index
        kept = [line for line in lines[:-_RECENT] if line[2] != "info"]
        self._log.renew([*kept[-_IMPORTANT:], *lines[-_RECENT:]])
        self._fact = None
        return len(self._log.values) - 1

    def _run(self) -> PageChange:
        about, run = self._mission.about, self._mission.runs[-1] if self._mission.runs else None
        if run is None:
            return {"number": 0}
        return {
            "number": run.number,
            "id": run_identity(run.number, run.about),
            "began": self._began,
            "wall": self._mission.runs[0].began.wall,
            "mission": self._mission.title,
            "is_simulated": bool(about.get("simulated")),
            "node": str(run.about.get("node") or ""),
            "ended": {"ending": run.ending, "status": run.status, "reason": run.reason}
            if run.ending
            else None,
        }

    def _tree(self) -> list[PageChange]:
        runs = self._mission.runs
        looks = runs[-1].about.get("looks") if runs else None
        shown = [(str(look[0]), str(look[-1])) for look in looks if look] if isinstance(looks, list) else []
        return [
            {
                "name": node.name,
                "path": node.kind,
                "shape": shown[node.number][0] if node.number < len(shown) else "",
                "sign": shown[node.number][1] if node.number < len(shown) else "",
                "parent": -1 if node.parent is None else node.parent,
                "file": node.file,
                "line": node.line,
                "attributes": {
                    **{key: node.outline[key] for key in ("memory", "policy") if key in node.outline},
                    **(node.attributes if isinstance(node.attributes, Mapping) else {}),
                },
            }
            for node in self._mission.nodes
        ]

    def _landmark(self, key: tuple[str, str]) -> PageChange | None:
        known: Landmark | None = self._mission.situation.landmarks.get(key)
        if known is None:
            return None
        details = {
            name: {"run": each.run, "time": each.time} if isinstance(each, EventTime) else each
            for name, each in known.details.items()
            if each not in (None, "")
        }
        return {**known._asdict(), "level": int(known.level), "details": details, "identity": known.identity}

    def _raster(self, name: str) -> PageChange:
        return self._mission.situation.rasters[name]._asdict()

    def _north(self) -> float | None:
        """Return the direction of north as an angle from the x axis of the frame `map`, in radians.

        Return None if the direction is unknown.
        """
        georeference = Georeference.from_parameters(self._mission.parameters)
        return None if georeference is None else math.radians(georeference.heading)

    def _alarms(self) -> list[PageChange]:
        mission = self._mission
        return [
            {**alarm._asdict(), "run": mission.since[text].run, "time": mission.since[text].time}
            for text, alarm in mission.situation.alarms.items()
        ]

    def _properties(self) -> PageChange:
        mission = self._mission
        watched = [
            {
                "name": each.name,
                "word": mission.word_of(each),
                "since": each.broken and each.broken.time,
                "event": each.event,
                "if_broken": each.if_broken,
            }
            for each in mission.properties.values()
        ]
        return {
            "watched": watched,
            "assumption_failed_at": mission.assumption_failed_at and mission.assumption_failed_at.time,
        }

    def _pose_values(self) -> PageChange | None:
        pose = self._mission.pose
        return None if pose is None else {"x": pose.x, "y": pose.y, "yaw": pose.yaw}

    _HANDLERS: ClassVar[Mapping[str, Callable[["PageState", JournalEntry], None]]] = {
        events.RUN_BEGAN: _on_run_began,
        events.RUN_ENDED: _on_run_ended,
        events.STATUS: _on_status,
        events.POSE: _on_pose,
        events.LOG: _on_log,
        events.CHANGED: _on_changed,
    }
    # The parts of the state that an entry changes, by the kind of the entry.
    _PARTS: ClassVar[Mapping[str, tuple[str, ...]]] = {
        events.RUN_BEGAN: (
            "run",
            "awaited",
            "nodes",
            "plan",
            "drive",
            "why",
            "condition",
            "tasks",
            "resume",
            "place",
            "estimate",
            "times",
            "north",
            "properties",
        ),
        events.RUN_ENDED: ("run", "drive", "condition", "tasks", "resume", "place", "estimate", "properties"),
        events.GOAL_SENT: ("condition", "tasks"),
        events.GOAL_ENDED: ("drive", "plan", "condition", "tasks", "estimate"),
        events.CHANGED: ("condition", "tasks", "place", "estimate"),
        events.POSE: ("pose",),
        events.PLAN: ("plan",),
        events.PROGRESS: ("drive", "condition", "estimate"),
        events.LACKS: ("condition", "tasks"),
        events.BREAKPOINT: ("condition", "tasks"),
        events.BATTERY: ("gauges", "tasks"),
        events.MAP: ("map",),
        events.PROPERTIES_WATCHED: ("properties",),
        events.PROPERTIES_OWED: ("properties",),
        events.PROPERTY_BROKEN: ("properties",),
        events.ASSUMPTION_FAILED: ("properties",),
    }
    _TIMED = (events.POSE, events.PLAN, events.MAP)
    _SITUATION = frozenset(("kinds", "figures", "gauges", "alarms", "objects"))
    # The parts of the state that are replaced as a whole, in the order of transmission.
    _READ: ClassVar[Mapping[str, Callable[["PageState"], Any]]] = {
        "run": _run,
        "awaited": lambda self: [each._asdict() for each in self._mission.awaited],
        "time": lambda self: self._mission.now.time + self._passed,
        "nodes": _tree,
        "pose": _pose_values,
        "plan": lambda self: self._mission.plan,
        "drive": lambda self: self._mission.drive and self._mission.drive._asdict(),
        "condition": lambda self: condition(self._mission)._asdict(),
        "tasks": lambda self: [task._asdict() for task in find_open_tasks(self._mission)],
        "resume": lambda self: resume_command(self._mission, self._journal),
        "place": lambda self: self._mission.situation.phase.place,
        "objects": lambda self: dict(self._mission.situation.objects),
        "estimate": lambda self: {"end": self._mission.likely_end, "limit": self._mission.time_limit_sec},
        "times": lambda self: self._times,
        "north": _north,
        "map": lambda self: self._mission.map or None,
        "kinds": lambda self: {name: each._asdict() for name, each in self._mission.situation.kinds.items()},
        "figures": lambda self: [
            {**each._asdict(), "text": each.text} for each in self._mission.situation.figures.values()
        ],
        "gauges": lambda self: [each._asdict() for each in self._mission.gauges],
        "alarms": _alarms,
        "properties": _properties,
        "why": lambda self: self._why,
    }


def all_changes(states: Iterable[PageState]) -> list[PageChange]:
    """Return the changes of several robots' states since the last call."""
    return [change for state in states if (change := state.change()) is not None]
