"""The operator's commands: the declaration of each command, and the commands given so far."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.leaves import find_interface, is_node_valid, turn_by
from sar_compiler.missions import (
    CommandAuthor,
    CommandField,
    Journal,
    JournalEntry,
    OperatorCommand,
    mission_context,
)
from search_and_rescue import search_events
from search_and_rescue.zone_manager import MAP_FRAME

if TYPE_CHECKING:
    from rclpy.node import Node

_UNKNOWN_AUTHOR = "the operator"


@mission_context
class OperatorCommands:
    """The commands that the operator has given in one mission, and the services for commands.

    The services are created by the leaves that execute the commands. A tree without such leaves therefore
    offers no service.

    Attributes:
        given: Author and reason of each command in effect, by command name.
        held: Whether the mission is paused.
        plan_change: Description of the last change of the plan that `NotHeld` has not processed; empty if there is none.
        has_skipped: Whether a zone was skipped since `NotHeld` last processed a change of the plan.
        journal: Records the commands that change the mission's mode. The `ZoneManager` and the `MissionRecord` record the other commands.
    """

    def __init__(self) -> None:
        self.journal = Journal(apply=self.apply)
        self.given: dict[str, str] = {}
        self.held = self.has_skipped = False
        self.plan_change = ""
        self._services: dict[str, tuple[Node, Any]] = {}

    @property
    def author(self) -> CommandAuthor:
        """The author of the command that is being executed: a name, such as `Ann (page, 127.0.0.1)`, and a reason."""
        author = self.journal.author
        return author if author.name else CommandAuthor(_UNKNOWN_AUTHOR)

    def record(self, command: str) -> None:
        """Record a command that changes the mission's mode: `pause`, `resume`, `go_home` or `abort`."""
        self.journal.record_event(
            search_events.COMMAND_GIVEN, command=command, by=self.author.name, reason=self.author.reason
        )

    def change_plan(self, how: str, *, skips: bool = False) -> None:
        """Store a change of the plan, so that `NotHeld` restarts the mission.

        Args:
            how: Description of the change.
            skips: Whether the change skipped a zone.
        """
        self.plan_change, self.has_skipped = how, self.has_skipped or skips

    def apply(self, fact: JournalEntry) -> None:
        """Update the commands from an event. Ignore events of other kinds.

        Raises:
            LookupError or ValueError: If the command is unknown, or does not change the mission's mode.
        """
        if fact.kind != search_events.COMMAND_GIVEN:
            return
        command = fact.data["command"]
        if not _COMMANDS[command].done:
            raise ValueError(f"{command!r} does not change the mission's mode")
        # A repeated command that is still in effect keeps the first author and reason.
        in_effect = self.held if command == "pause" else command != "resume"
        if not (in_effect and command in self.given):
            self.given[command] = str(CommandAuthor.from_data(fact.data))
        # A command to return home or to abort also ends a pause.
        self.held = command == "pause"

    def describe(self, command: str) -> str:
        """Describe a command by effect, author and reason: `paused by Ann (page, 127.0.0.1): smoke in the corridor`."""
        return f"{_COMMANDS[command].done} by {self.given.get(command, _UNKNOWN_AUTHOR)}"

    def line(self, command: str, more: str = "") -> str:
        """Return a log line about the command that is being executed. The first sentence ends with `more`."""
        by, reason = self.author
        sentence = f"Command {command} by {by}{f': {more}' if more else ''}."
        return f"{sentence} Reason: {reason}." if reason else sentence

    def offer(self, node: "Node", command: str, execute: Callable[[Any, Any], Any]) -> None:
        """Create the service of a command on a node. Do nothing if another leaf has already created the service.

        Args:
            node: The mission's node.
            command: The name of the command.
            execute: The service callback: receives the request and the response, and returns the response.
        """
        if command not in self._services:
            kind = find_interface("CommandSpec", "srv", command, _COMMANDS[command].verb.service_type)
            self._services[command] = node, node.create_service(kind, f"~/{command}", execute)

    def destroy_services(self) -> None:
        """Destroy all services that were not already destroyed together with their node."""
        services, self._services = self._services, {}
        for node, service in services.values():
            if is_node_valid(node):
                node.destroy_service(service)


def _add_zone(request: Any, values: Mapping[str, Any]) -> None:
    request.zone_id = values["zone"]
    request.pose.header.frame_id = MAP_FRAME
    point, orientation = request.pose.pose.position, request.pose.pose.orientation
    point.x, point.y = values["x"], values["y"]
    turn_by(orientation, math.radians(values["heading"]))


def _add_hint(request: Any, values: Mapping[str, Any]) -> None:
    request.zone_id, request.likelihood_ratio = values["zone"], values["times"]
    request.point.header.frame_id = MAP_FRAME
    # The leaf refuses a hint that has neither a zone nor a position.
    request.point.point.x, request.point.point.y = (
        math.nan if values[axis] is None else values[axis] for axis in ("x", "y")
    )


def _add_area(request: Any, values: Mapping[str, Any]) -> None:
    from geometry_msgs.msg import Point32

    request.zone_id, request.outline.header.frame_id = values["zone"], MAP_FRAME
    request.outline.polygon.points = [Point32(x=x, y=y) for x, y in values["corners"]]
    request.poa, request.detection_range = (
        math.nan if values[name] is None else values[name] for name in ("poa", "detection_range")
    )


def _review_survivor(request: Any, values: Mapping[str, Any]) -> None:
    request.survivor_id, request.same_as = values["survivor"], values["same_as"]
    request.verdict = getattr(type(request), values["verdict"])


def _position_text(x: float, y: float) -> str:
    return f"({x:.2f}, {y:.2f})"


def _command_text(command: str, by: str, reason: str = "") -> str:
    return f"{by}: {_COMMANDS[command].verb.label.lower()}{f': {reason}' if reason else ''}"


def _added_text(id: str, x: float, y: float, yaw: float) -> str:  # noqa: A002, ARG001 - the event's keys
    return f"{_UNKNOWN_AUTHOR}: {id} was added at {_position_text(x, y)}"


def _drawn_text(zone: str, polygon: Sequence[object], **_more: object) -> str:
    return f"{_UNKNOWN_AUTHOR}: the area {zone} was drawn, with {len(polygon)} corners"


def _hint_text(zone: str, ratio: float) -> str:
    return f"{_UNKNOWN_AUTHOR}: a hint on {zone}, times {ratio:g}"


def _review_text(survivor: str, standing: str, same_as: str | None) -> str:
    return f"{_UNKNOWN_AUTHOR}: {survivor} is {standing}{f' with {same_as}' if same_as else ''}"


class CommandSpec(NamedTuple):
    """The declaration of a command that an operator can give.

    Attributes:
        verb: The command's service, the fields of the service's request, and the command's button.
        served_by: Tags of the leaves that offer the service; a tree needs at least one of these leaves.
        fact: The kind of the event that records the command.
        sentence: Formats the event as a sentence; None if leaves also record events of this kind without a command.
        done: The effect in messages, such as `paused`; messages add `by` and the author. Empty if the command
            does not change the mode.
    """

    verb: OperatorCommand
    served_by: tuple[str, ...]
    fact: str = search_events.COMMAND_GIVEN
    sentence: Callable[..., str] | None = _command_text
    done: str = ""


COMMANDS = (
    CommandSpec(
        OperatorCommand("pause", "Pause", "The robot stops, and its goal is cancelled.", role="hold"),
        ("NotHeld",),
        done="paused",
    ),
    CommandSpec(
        OperatorCommand("resume", "Resume", "The mission resumes.", role="release"),
        ("NotHeld",),
        done="resumed",
    ),
    CommandSpec(
        OperatorCommand(
            "skip_zone",
            "Skip zone",
            "The current zone is abandoned.",
            confirm="This zone will not be searched. This mission will not find anyone who is in this zone.",
            named="Skip {}",
        ),
        ("NotHeld",),
        search_events.ZONE_ABANDONED,
        None,
    ),
    CommandSpec(
        OperatorCommand(
            "add_zone",
            "Add zone",
            "A new zone is added at the end of the plan.",
            "sar_interfaces/srv/AddZone",
            (
                CommandField("zone", "Name", landmark="zone"),
                CommandField("x", "x, metres", "number"),
                CommandField("y", "y, metres", "number"),
                CommandField("heading", "heading, degrees counterclockwise from x", "number"),
            ),
            fill=_add_zone,
        ),
        ("NotHeld",),
        search_events.ZONE_ADDED,
        _added_text,
    ),
    CommandSpec(
        OperatorCommand(
            "add_area",
            "Draw an area",
            "A new area is swept. You can also change an existing area if its search has not started.",
            "sar_interfaces/srv/AddArea",
            (
                CommandField(
                    "zone", "Name (the name of an existing area changes this area)", landmark="zone"
                ),
                CommandField("corners", "Corners", "polygon", optional=True),
                CommandField("poa", "probability that a person is there, 0 to 1", "number", optional=True),
                CommandField(
                    "detection_range", "maximum distance of a detection, metres", "number", optional=True
                ),
            ),
            fill=_add_area,
        ),
        ("PlanSweep",),
        search_events.AREA_DRAWN,
        _drawn_text,
    ),
    CommandSpec(
        OperatorCommand(
            "add_hint",
            "Add a hint",
            "Report that a person is more or less likely to be in a zone. The hint takes effect when the next zone is chosen.",
            "sar_interfaces/srv/AddHint",
            (
                CommandField(
                    "zone",
                    "Zone (if empty: the zone at the position, or the nearest zone)",
                    optional=True,
                    landmark="zone",
                ),
                CommandField("x", "x, metres", "number", optional=True),
                CommandField("y", "y, metres", "number", optional=True),
                CommandField(
                    "times", "likelihood ratio, such as 3 for more likely or 0.3 for less likely", "number"
                ),
            ),
            fill=_add_hint,
        ),
        ("ChooseZone",),
        search_events.HINT_GIVEN,
        _hint_text,
    ),
    CommandSpec(
        OperatorCommand(
            "judge_survivor",
            "Review a detection",
            "Decide whether a detection is a survivor.",
            "sar_interfaces/srv/JudgeSurvivor",
            (
                CommandField("survivor", "Detection", "found"),
                CommandField(
                    "verdict",
                    "It is",
                    "choice",
                    (
                        ("CONFIRMED", "a survivor"),
                        ("REJECTED", "no survivor"),
                        ("SAME", "a duplicate of another"),
                    ),
                ),
                CommandField("same_as", "Duplicate of", "found", optional=True),
            ),
            fill=_review_survivor,
        ),
        ("NotHeld",),
        search_events.SURVIVOR_JUDGED,
        _review_text,
    ),
    CommandSpec(
        OperatorCommand(
            "go_home",
            "Go home",
            "The robot returns to the base station.",
            confirm="The robot returns home. The remaining zones are not searched.",
        ),
        ("NotRecalled",),
        done="called home",
    ),
    CommandSpec(
        OperatorCommand(
            "abort",
            "Abort",
            "The mission ends, and the robot stays where it is.",
            confirm="The mission ends here, and the robot must be fetched. You cannot undo this.",
            role="stop",
        ),
        ("NotAborted",),
        done="aborted",
    ),
)
"""All commands, in the order of their buttons."""

_COMMANDS = {each.verb.name: each for each in COMMANDS}

VERBS = tuple(each.verb for each in COMMANDS)
"""The service and the button of each command."""

SENTENCES: Mapping[str, Callable[..., str]] = {
    each.fact: each.sentence for each in COMMANDS if each.sentence is not None
}
"""For each kind of command event, the function that formats such an event as a sentence."""
