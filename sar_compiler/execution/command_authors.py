"""Announces the author and the reason of each operator command, and records them in the journal."""

import time
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from functools import partial
from inspect import iscoroutinefunction
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.journal.command_objects import SeenObjects, parse_seen
from sar_compiler.journal.journal_entries import ORDERED, CommandAuthor
from sar_compiler.json_values import json_text
from sar_compiler.missions.mission import OperatorCommand

if TYPE_CHECKING:
    from rcl_interfaces.msg import SetParametersResult
    from rclpy.node import Node
    from rclpy.parameter import Parameter

    from sar_compiler.journal.journal import Journal

# Command services have no field for the author, so `std_srvs/srv/Trigger` is enough for most commands. Before a client calls `~/pause`, it sets
# the parameter `ordered_by.pause` of the mission's node: to the author's name, or to the name, a reason and the objects that the author saw
# (JSON).
_PARAMETER = "ordered_by"
_UNNAMED_AUTHOR = "a service call"
# Maximum time from an announcement to its service call, in seconds of the steady clock.
_ANNOUNCEMENT_VALID_SEC = 10.0
# Maximum length of a name or reason, in characters.
_LONGEST = 200
# Maximum wait for the mission's response to an announcement, in seconds of the steady clock.
_RESPONSE_SEC = 1.0


_NOTHING_SEEN: SeenObjects = {}


def _ignore(_: str) -> None:
    """Ignore the reason why a command was not sent."""


class _Announcement(NamedTuple):
    """The announcement of a command: its author, the objects that the author saw, and the time of the announcement.

    The time is in seconds of the steady clock.
    """

    author: CommandAuthor
    seen: SeenObjects
    at: float = 0.0


class CommandAuthors:
    """Records each command that a mission receives in the journal, together with its author.

    Args:
        node: The mission's node.
        verbs: The mission's commands.
        journal: The mission's journal.
    """

    def __init__(self, node: "Node", verbs: Sequence[OperatorCommand], journal: "Journal") -> None:
        self._node, self._journal = node, journal
        self._verbs = {verb.name: verb for verb in verbs}
        self._signed: defaultdict[str, deque[_Announcement]] = defaultdict(deque)
        self._last_seen: dict[str, _Announcement] = {}
        node.add_on_set_parameters_callback(self._on_parameters)

    def begin(self) -> None:
        """Start recording calls of the command services. The leaves must have created these services already."""
        names = {self._node.resolve_service_name(f"~/{name}"): verb for name, verb in self._verbs.items()}
        for service in self._node.services:
            verb = names.get(service.service_name)
            if verb is not None and not iscoroutinefunction(service.callback):
                service.callback = partial(self._execute, verb, service.callback)

    def sign(
        self,
        verb: str,
        author: CommandAuthor,
        then: Callable[[], object],
        seen: SeenObjects = _NOTHING_SEEN,
        refuse: Callable[[str], object] = _ignore,  # noqa: ARG002 - an announcement in this process cannot fail
    ) -> None:
        """Store a command's author and the objects that the author saw; then call *then* to send the command."""
        self._store(verb, author, seen)
        then()

    def _store(self, verb: str, author: CommandAuthor, seen: SeenObjects) -> None:
        signature = _Announcement(CommandAuthor(*map(escape_to_single_line, author)), seen, time.monotonic())
        self._signed[verb].append(signature)
        if seen:
            self._last_seen[verb] = signature

    def _signature(self, verb: str) -> "_Announcement":
        """Return the announcement that belongs to the current call of a command's service.

        A call that was not announced may have used up the announcement of another call. So every call without an announcement is checked
        against the objects that were announced last.
        """
        signed, oldest = self._signed[verb], time.monotonic() - _ANNOUNCEMENT_VALID_SEC
        last = self._last_seen.get(verb)
        unsigned = _Announcement(
            CommandAuthor(_UNNAMED_AUTHOR), last.seen if last and last.at > oldest else _NOTHING_SEEN
        )
        while signed:
            signature = signed.popleft()
            if signature.at > oldest and (any(signature.author) or signature.seen):
                author = signature.author
                return signature._replace(author=author._replace(name=author.name or _UNNAMED_AUTHOR))
        return unsigned

    def _on_parameters(self, parameters: "list[Parameter]") -> "SetParametersResult":
        from rcl_interfaces.msg import SetParametersResult

        for each in parameters:
            group, _, verb = each.name.partition(".")
            if group == _PARAMETER and verb in self._verbs:
                values = [*map(str, each.value if isinstance(each.value, list) else [each.value])]
                try:
                    seen = parse_seen(values[2]) if len(values) > 2 else _NOTHING_SEEN  # noqa: PLR2004 - after name and reason
                except ValueError as error:
                    return SetParametersResult(
                        successful=False, reason=f"{each.name}: the third value is {error}"
                    )
                self._store(verb, CommandAuthor(*values[:2]), seen)
        return SetParametersResult(successful=True)

    def _execute(
        self, verb: OperatorCommand, callback: Callable[[Any, Any], Any], request: Any, response: Any
    ) -> Any:
        author, seen, _ = self._signature(verb.name)
        with self._journal.ordered_by(author) as recorded_kinds:
            changed = self._journal.describe_change(verb.name, seen)
            if changed:
                response.success, response.message = (
                    False,
                    f"{changed}. Check the change, and repeat the command",
                )
                result = response
            else:
                result = callback(request, response)
        # A user's own service may return an object without these fields. The mission must still continue.
        refusal = "" if getattr(result, "success", True) else str(getattr(result, "message", ""))
        by, reason = author
        command = {"verb": verb.name, "label": verb.label, "by": by, "reason": reason, "refusal": refusal}
        self._journal.record_observation(ORDERED, **command, is_told=bool(recorded_kinds))
        return result


def escape_to_single_line(text: str) -> str:
    """Shorten untrusted text for use in a sentence: one line, at most 200 characters, no final full stop."""
    return "".join(filter(str.isprintable, text))[:_LONGEST].strip().removesuffix(".")


class RemoteCommandAuthor:
    """Announces the authors of commands to a mission that runs in another process.

    Args:
        node: The node that sends the announcements.
        of: The full name of the mission's node.
    """

    def __init__(self, node: "Node", of: str) -> None:
        from rcl_interfaces.srv import SetParameters

        self._node = node
        self._client: Any = node.create_client(SetParameters, f"{of}/set_parameters")

    def sign(
        self,
        verb: str,
        author: CommandAuthor,
        then: Callable[[], object],
        seen: SeenObjects = _NOTHING_SEEN,
        refuse: Callable[[str], object] = _ignore,
    ) -> None:
        """Announce the author of a command. When the mission has responded, call *then* to send the command.

        No announcement is sent to a node that has no parameter services. The response can be lost if two nodes have just discovered each
        other. If the announcement is not confirmed, the command is sent only if the author saw no objects. Otherwise *refuse* is called
        with the reason, because an object may have changed.
        """
        from rclpy.parameter import Parameter

        from sar_compiler.ros.clock import steady_timer

        def send(*, is_heard: bool) -> None:
            if is_heard or not seen:
                then()
            else:
                refuse(
                    "the command was not sent, because the mission has not confirmed the object that the command refers to. Repeat the "
                    "command"
                )

        if not self._client.service_is_ready():
            send(is_heard=False)
            return

        def call_service(future: Any = None) -> None:
            if not timer.is_canceled():
                timer.cancel()
                self._node.destroy_timer(timer)
                send(is_heard=future is not None and _is_accepted(future))

        timer = steady_timer(self._node, _RESPONSE_SEC, call_service)
        request = self._client.srv_type.Request()
        announced = [*author, *([json_text(dict(seen))] if seen else [])]
        request.parameters = [Parameter(f"{_PARAMETER}.{verb}", value=announced).to_parameter_msg()]
        self._client.call_async(request).add_done_callback(call_service)


def _is_accepted(future: Any) -> bool:
    try:
        return all(each.successful for each in future.result().results)
    except Exception:  # noqa: BLE001 - a failing call raises arbitrary exceptions
        return False
