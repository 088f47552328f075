"""The operator's commands, each declared with its service, button, event and text."""

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
    """The operator's commands with their authors, until they take effect.

    The services belong to the leaves that execute the commands: a tree without these leaves offers none.

    Attributes:
        given: Author and reason of each command in effect, by the command's name.
        held: Whether the mission is paused.
        plan_change: Description of the last change of the plan, which the mission must take into account; empty if there is none.
        has_skipped: Whether that change skipped a zone.
        journal: Records commands (`search_events.COMMAND_GIVEN`); the owners of zones and survivors record commands on these.
    """

    def __init__(self) -> None:
        self.journal = Journal(apply=self.apply)
        self.given: dict[str, str] = {}
        self.held = self.has_skipped = False
        self.plan_change = ""
        self._services: dict[str, tuple[Node, Any]] = {}

    @property
    def author(self) -> CommandAuthor:
        """Author and reason of the current command: `Ann (page, 127.0.0.1)`, `the property 'home at the end'`."""
        author = self.journal.author
        return author if author.name else CommandAuthor(_UNKNOWN_AUTHOR)

    def record(self, command: str) -> None:
        """Record a command that changes the mission's mode: `pause`, `resume`, `go_home` or `abort`."""
        self.journal.record_event(
            search_events.COMMAND_GIVEN, command=command, by=self.author.name, reason=self.author.reason
        )

    def change_plan(self, how: str, *, skips: bool = False) -> None:
        """Request that the mission re-evaluates its plan.

        Args:
            how: Description of the change.
            skips: Whether a zone was skipped.
        """
        self.plan_change, self.has_skipped = how, self.has_skipped or skips

    def apply(self, fact: JournalEntry) -> None:
        """Apply the event of a command.

        Raises:
            LookupError or ValueError: If the command is unknown.
        """
        if fact.kind != search_events.COMMAND_GIVEN:
            return
        command = fact.data["command"]
        if not _COMMANDS[command].done:
            raise ValueError(f"{command!r} does not change the mission's mode")
        # Repeating a command in effect changes nothing, not even its author.
        lasts = self.held if command == "pause" else command != "resume"
        if not (lasts and command in self.given):
            self.given[command] = str(CommandAuthor.from_data(fact.data))
        # A mission that returns home or was aborted is no longer paused.
        self.held = command == "pause"

    def describe(self, command: str) -> str:
        """Return a command's effect, author and reason: `paused by Ann (page, 127.0.0.1): smoke in the corridor`."""
        return f"{_COMMANDS[command].done} by {self.given.get(command, _UNKNOWN_AUTHOR)}"

    def line(self, command: str, more: str = "") -> str:
        """Return a log line about the current command."""
        by, reason = self.author
        said = f"Command {command} by {by}{f': {more}' if more else ''}."
        return f"{said} Reason: {reason}." if reason else said

    def offer(self, node: "Node", command: str, answer: Callable[[Any, Any], Any]) -> None:
        """Offer the service `~/command` on a node, unless another leaf already does.

        Args:
            node: The mission's node.
            command: The name of the command.
            answer: The service callback: receives the request and the response, and returns the response.
        """
        if command not in self._services:
            kind = find_interface("CommandSpec", "srv", command, _COMMANDS[command].verb.service_type)
            self._services[command] = node, node.create_service(kind, f"~/{command}", answer)

    def destroy_services(self) -> None:
        """Destroy the services, unless they were destroyed with their node."""
        services, self._services = self._services, {}
        for node, service in services.values():
            if is_node_valid(node):
                node.destroy_service(service)


def _add_zone(request: Any, values: Mapping[str, Any]) -> None:
    request.zone_id = values["zone"]
    request.pose.header.frame_id = MAP_FRAME
    place, turn = request.pose.pose.position, request.pose.pose.orientation
    place.x, place.y = values["x"], values["y"]
    turn_by(turn, math.radians(values["heading"]))


def _add_hint(request: Any, values: Mapping[str, Any]) -> None:
    request.zone_id, request.likelihood_ratio = values["zone"], values["times"]
    request.point.header.frame_id = MAP_FRAME
    # Without a zone and a position it is refused.
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


def _judge(request: Any, values: Mapping[str, Any]) -> None:
    request.survivor_id, request.same_as = values["survivor"], values["same_as"]
    request.verdict = getattr(type(request), values["verdict"])


def _position_text(x: float, y: float) -> str:
    return f"({x:.2f}, {y:.2f})"


def _given_text(command: str, by: str, reason: str = "") -> str:
    return f"{by}: {_COMMANDS[command].verb.label.lower()}{f': {reason}' if reason else ''}"


def _added_text(id: str, x: float, y: float, yaw: float) -> str:  # noqa: A002, ARG001 - the event's keys
    return f"{_UNKNOWN_AUTHOR}: {id} was added at {_position_text(x, y)}"


def _drawn_text(zone: str, polygon: Sequence[object], **_more: object) -> str:
    return f"{_UNKNOWN_AUTHOR}: the area {zone} was drawn, with {len(polygon)} corners"


def _hint_text(zone: str, ratio: float) -> str:
    return f"{_UNKNOWN_AUTHOR}: a hint on {zone}, times {ratio:g}"


def _judged_text(survivor: str, standing: str, same_as: str | None) -> str:
    return f"{_UNKNOWN_AUTHOR}: {survivor} is {standing}{f' with {same_as}' if same_as else ''}"


class CommandSpec(NamedTuple):
    """A command to the mission.

    Attributes:
        verb: Its service with the request's fields, and its button.
        served_by: Tags of the leaves that offer the service; a tree needs one of them.
        fact: The kind of the event that records it.
        sentence: Formats the event as a sentence; None if leaves also record this kind without a command.
        done: Its effect, followed by `by` and the author in messages; empty for a command that only changes the plan or the probabilities.
    """

    verb: OperatorCommand
    served_by: tuple[str, ...]
    fact: str = search_events.COMMAND_GIVEN
    sentence: Callable[..., str] | None = _given_text
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
            confirm="This zone will not be searched. Anyone in it will not be found by this mission.",
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
            "A further zone is added at the end of the plan.",
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
            "A further area is swept. An area whose search has not started can be changed.",
            "sar_interfaces/srv/AddArea",
            (
                CommandField("zone", "Name; an existing name changes that area", landmark="zone"),
                CommandField("corners", "Corners", "polygon", optional=True),
                CommandField("poa", "probability that a person is there, 0 to 1", "number", optional=True),
                CommandField(
                    "detection_range", "how far a survivor can be seen, metres", "number", optional=True
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
            "A person is more or less likely in a zone. Takes effect when the next zone is chosen.",
            "sar_interfaces/srv/AddHint",
            (
                CommandField(
                    "zone",
                    "Zone; empty for the one at the position, or the nearest",
                    optional=True,
                    landmark="zone",
                ),
                CommandField("x", "x, metres", "number", optional=True),
                CommandField("y", "y, metres", "number", optional=True),
                CommandField("times", "likelihood ratio: 3 for more likely, 0.3 for less", "number"),
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
            fill=_judge,
        ),
        ("NotHeld",),
        search_events.SURVIVOR_JUDGED,
        _judged_text,
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
"""Their services and buttons."""

SENTENCES: Mapping[str, Callable[..., str]] = {
    each.fact: each.sentence for each in COMMANDS if each.sentence is not None
}
"""Texts of the events of commands, by kind."""
