"""The commands to a mission under way, each declared once: its service, its button, the fact that records it, and what is said of it."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.leaves import alive, find_interface, turn_by
from sar_compiler.missions import CommandAuthor, Journal, JournalEntry, Verb, VerbField, mission_context
from search_and_rescue import search_events
from search_and_rescue.zone_manager import MAP_FRAME

if TYPE_CHECKING:
    from rclpy.node import Node

_UNKNOWN_AUTHOR = "the operator"


@mission_context
class OperatorOrders:
    """The commands that were given, until they are heeded, with their authors.

    The services are those of the leaves that heed the commands: a tree without them offers none.

    Attributes:
        given: The author and the reason, in words, of each command that was given and lasts, by the command's name.
        held: Whether the robot is to stand where it is.
        plan_change: How the plan has changed, in words, so that the mission must look at it anew; empty if it has not.
        has_skipped: Whether a zone was skipped in that.
        journal: Where commands are written (`search_events.COMMAND_GIVEN`); those on zones and survivors by who keeps these.
    """

    def __init__(self) -> None:
        self.journal = Journal(apply=self.apply)
        self.given: dict[str, str] = {}
        self.held = self.has_skipped = False
        self.plan_change = ""
        self._services: dict[str, tuple[Node, Any]] = {}

    @property
    def author(self) -> CommandAuthor:
        """Who gives the command that is being carried out, and why: `Ann (page, 127.0.0.1)`, `the property 'home at the end'`."""
        author = self.journal.author
        return author if author.name else CommandAuthor(_UNKNOWN_AUTHOR)

    def give(self, command: str) -> None:
        """Give a command that changes what the mission is at: `pause`, `resume`, `go_home` or `abort`."""
        self.journal.note(
            search_events.COMMAND_GIVEN, command=command, by=self.author.name, reason=self.author.reason
        )

    def change_plan(self, how: str, *, skips: bool = False) -> None:
        """Have the mission look at its plan anew.

        Args:
            how: How the plan has changed, in words.
            skips: Whether a zone was skipped.
        """
        self.plan_change, self.has_skipped = how, self.has_skipped or skips

    def apply(self, fact: JournalEntry) -> None:
        """Take a command that is a fact.

        Raises:
            LookupError or ValueError: If there is no such command.
        """
        if fact.kind != search_events.COMMAND_GIVEN:
            return
        command = fact.data["command"]
        if not _COMMANDS[command].done:
            raise ValueError(f"{command!r} does not change what the mission is at")
        # A command that is given again while it lasts changes nothing, not even who has given it.
        lasts = self.held if command == "pause" else command != "resume"
        if not (lasts and command in self.given):
            self.given[command] = str(CommandAuthor.of(fact.data))
        # Who is called home, or has ended, is held no more.
        self.held = command == "pause"

    def said(self, command: str) -> str:
        """Return what a command has done, and who has given it why: `paused by Ann (page, 127.0.0.1): smoke in the corridor`."""
        return f"{_COMMANDS[command].done} by {self.given.get(command, _UNKNOWN_AUTHOR)}"

    def line(self, command: str, more: str = "") -> str:
        """Return a line for the log about the command that is being carried out."""
        by, reason = self.author
        said = f"Command {command} by {by}{f': {more}' if more else ''}."
        return f"{said} Reason: {reason}." if reason else said

    def offer(self, node: "Node", command: str, answer: Callable[[Any, Any], Any]) -> None:
        """Serve a command on a node, as `~/command`; another leaf may have done so before.

        Args:
            node: The mission's node.
            command: The name of the command.
            answer: Is called with the request and the response, and returns the response.
        """
        if command not in self._services:
            kind = find_interface("CommandSpec", "srv", command, _COMMANDS[command].verb.service_type)
            self._services[command] = node, node.create_service(kind, f"~/{command}", answer)

    def withdraw(self) -> None:
        """Destroy the services, which are gone already where their node is."""
        services, self._services = self._services, {}
        for node, service in services.values():
            if alive(node):
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
    # Without a zone and a place it is refused.
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


def _at(x: float, y: float) -> str:
    return f"({x:.2f}, {y:.2f})"


def _said_given(command: str, by: str, reason: str = "") -> str:
    return f"{by}: {_COMMANDS[command].verb.label.lower()}{f': {reason}' if reason else ''}"


def _said_added(id: str, x: float, y: float, yaw: float) -> str:  # noqa: A002, ARG001 - as the fact has it
    return f"{_UNKNOWN_AUTHOR}: {id} was added at {_at(x, y)}"


def _said_drawn(zone: str, polygon: Sequence[object], **_more: object) -> str:
    return f"{_UNKNOWN_AUTHOR}: the area {zone} was drawn, with {len(polygon)} corners"


def _said_hint(zone: str, ratio: float) -> str:
    return f"{_UNKNOWN_AUTHOR}: a hint on {zone}, times {ratio:g}"


def _said_judged(survivor: str, standing: str, same_as: str | None) -> str:
    return f"{_UNKNOWN_AUTHOR}: {survivor} is {standing}{f' with {same_as}' if same_as else ''}"


class CommandSpec(NamedTuple):
    """A command to the mission.

    Attributes:
        verb: Its service, with the request's fields, and its button.
        served_by: The tags of the leaves that offer the service, one of which a tree must have.
        fact: The kind of the fact that records it.
        sentence: Returns such a fact as a sentence, from its data; None if leaves note that kind without a command as well.
        done: What it has done, as said before `by` and its author; empty for one that only changes the plan or what is known.
    """

    verb: Verb
    served_by: tuple[str, ...]
    fact: str = search_events.COMMAND_GIVEN
    sentence: Callable[..., str] | None = _said_given
    done: str = ""


COMMANDS = (
    CommandSpec(
        Verb("pause", "Pause", "The robot stops where it is, and its goal is cancelled.", role="hold"),
        ("NotHeld",),
        done="paused",
    ),
    CommandSpec(
        Verb("resume", "Resume", "The mission goes on.", role="release"), ("NotHeld",), done="resumed"
    ),
    CommandSpec(
        Verb(
            "skip_zone",
            "Skip zone",
            "The current zone is given up.",
            confirm="The current zone will not be searched. Whoever is there is not looked for.",
        ),
        ("NotHeld",),
        search_events.ZONE_ABANDONED,
        None,
    ),
    CommandSpec(
        Verb(
            "add_zone",
            "Add zone",
            "A further zone, after all others.",
            "sar_interfaces/srv/AddZone",
            (
                VerbField("zone", "Name"),
                VerbField("x", "x, metres", "number"),
                VerbField("y", "y, metres", "number"),
                VerbField("heading", "heading, degrees counterclockwise from x", "number"),
            ),
            fill=_add_zone,
        ),
        ("NotHeld",),
        search_events.ZONE_ADDED,
        _said_added,
    ),
    CommandSpec(
        Verb(
            "add_area",
            "Draw an area",
            "A further area is swept, or one that nobody has begun to search is changed.",
            "sar_interfaces/srv/AddArea",
            (
                VerbField("zone", "Name; of an area that is there to change it"),
                VerbField("corners", "Corners", "polygon", optional=True),
                VerbField("poa", "probability that somebody is there, 0 to 1", "number", optional=True),
                VerbField(
                    "detection_range", "how far a survivor can be seen, metres", "number", optional=True
                ),
            ),
            fill=_add_area,
        ),
        ("PlanSweep",),
        search_events.AREA_DRAWN,
        _said_drawn,
    ),
    CommandSpec(
        Verb(
            "add_hint",
            "Add a hint",
            "Somebody may be, or is hardly, in a zone: it counts when the next zone is chosen.",
            "sar_interfaces/srv/AddHint",
            (
                VerbField("zone", "Zone; empty for the one around a place, or nearest to it", optional=True),
                VerbField("x", "x, metres", "number", optional=True),
                VerbField("y", "y, metres", "number", optional=True),
                VerbField("times", "times likelier: 3 for, 0.3 against", "number"),
            ),
            fill=_add_hint,
        ),
        ("ChooseZone",),
        search_events.HINT_GIVEN,
        _said_hint,
    ),
    CommandSpec(
        Verb(
            "judge_survivor",
            "Judge a find",
            "Judge whether a find is a survivor.",
            "sar_interfaces/srv/JudgeSurvivor",
            (
                VerbField("survivor", "Find", "found"),
                VerbField(
                    "verdict",
                    "It is",
                    "choice",
                    (
                        ("CONFIRMED", "a survivor"),
                        ("REJECTED", "nobody"),
                        ("SAME", "the same one as another"),
                    ),
                ),
                VerbField("same_as", "The same as", "found", optional=True),
            ),
            fill=_judge,
        ),
        ("NotHeld",),
        search_events.SURVIVOR_JUDGED,
        _said_judged,
    ),
    CommandSpec(
        Verb(
            "go_home",
            "Go home",
            "The robot comes back to the base station.",
            confirm="The robot comes home, and the zones that are left are not searched.",
        ),
        ("NotRecalled",),
        done="called home",
    ),
    CommandSpec(
        Verb(
            "abort",
            "Abort",
            "The mission ends where the robot stands.",
            confirm="The mission ends here and now, and the robot stays where it is.",
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
"""What is said of the facts of commands, by their kinds."""
