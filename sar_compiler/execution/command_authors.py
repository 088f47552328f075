"""Authors and reasons of commands: announced before each service call, and recorded in the journal."""

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

# The services of commands have no field for the author, so that `std_srvs/srv/Trigger` suffices and all commands work alike. Before a client
# calls `~/pause`, it sets the parameter `ordered_by.pause` of the node to a name, or to a name, a reason, and what the sender saw (JSON).
_PARAMETER = "ordered_by"
_A_CALL = "a service call"
# Longest time from the announcement to the call, in seconds of the steady clock, and longest text.
_SIGNED_SEC, _LONGEST = 10.0, 200
# Longest wait for the mission's response to the announcement, in the same units.
_HEARD_SEC = 1.0


_NOTHING_SEEN: SeenObjects = {}


def _ignore(_: str) -> None:
    """Ignore a reason."""


class _Announcement(NamedTuple):
    """The announcement of a command: its author, the objects that they saw, and the time of the steady clock."""

    author: CommandAuthor
    seen: SeenObjects
    at: float = 0.0


class CommandAuthors:
    """Records each command to a mission in its journal, with its author.

    Args:
        node: The mission's node.
        verbs: The mission's commands.
        journal: Its journal.
    """

    def __init__(self, node: "Node", verbs: Sequence[OperatorCommand], journal: "Journal") -> None:
        self._node, self._journal = node, journal
        self._verbs = {verb.name: verb for verb in verbs}
        self._signed: defaultdict[str, deque[_Announcement]] = defaultdict(deque)
        self._last_seen: dict[str, _Announcement] = {}
        node.add_on_set_parameters_callback(self._on_parameters)

    def begin(self) -> None:
        """Start recording; the leaves have already created the services."""
        names = {self._node.resolve_service_name(f"~/{name}"): verb for name, verb in self._verbs.items()}
        for service in self._node.services:
            verb = names.get(service.service_name)
            if verb is not None and not iscoroutinefunction(service.callback):
                service.callback = partial(self._carry_out, verb, service.callback)

    def sign(
        self,
        verb: str,
        author: CommandAuthor,
        then: Callable[[], object],
        seen: SeenObjects = _NOTHING_SEEN,
        refuse: Callable[[str], object] = _ignore,  # noqa: ARG002 - an announcement in this process cannot fail
    ) -> None:
        """Store the author of the next call of a command's service, and the objects that they saw; run *then*, which calls it."""
        self._store(verb, author, seen)
        then()

    def _store(self, verb: str, author: CommandAuthor, seen: SeenObjects) -> None:
        signature = _Announcement(CommandAuthor(*map(escape_to_single_line, author)), seen, time.monotonic())
        self._signed[verb].append(signature)
        if seen:
            self._last_seen[verb] = signature

    def _signature(self, verb: str) -> "_Announcement":
        """Return the author of the current call of a command's service, and the objects that they saw.

        A call without an announcement may have consumed that of another call. So what was announced last applies to each call without one.
        """
        signed, oldest = self._signed[verb], time.monotonic() - _SIGNED_SEC
        last = self._last_seen.get(verb)
        unsigned = _Announcement(
            CommandAuthor(_A_CALL), last.seen if last and last.at > oldest else _NOTHING_SEEN
        )
        while signed:
            signature = signed.popleft()
            if signature.at > oldest and (any(signature.author) or signature.seen):
                author = signature.author
                return signature._replace(author=author._replace(name=author.name or _A_CALL))
        return unsigned

    def _on_parameters(self, parameters: "list[Parameter]") -> "SetParametersResult":
        from rcl_interfaces.msg import SetParametersResult

        for each in parameters:
            group, _, verb = each.name.partition(".")
            if group == _PARAMETER and verb in self._verbs:
                said = [*map(str, each.value if isinstance(each.value, list) else [each.value])]
                try:
                    seen = parse_seen(said[2]) if len(said) > 2 else _NOTHING_SEEN  # noqa: PLR2004 - after name and reason
                except ValueError as error:
                    return SetParametersResult(
                        successful=False, reason=f"{each.name}: the third value is {error}"
                    )
                self._store(verb, CommandAuthor(*said[:2]), seen)
        return SetParametersResult(successful=True)

    def _carry_out(
        self, verb: OperatorCommand, answer: Callable[[Any, Any], Any], request: Any, response: Any
    ) -> Any:
        author, seen, _ = self._signature(verb.name)
        with self._journal.ordered_by(author) as noted:
            changed = self._journal.describe_change(verb.name, seen)
            if changed:
                response.success, response.message = False, f"{changed}. Check it, and repeat the command"
                answered = response
            else:
                answered = answer(request, response)
        # Any response of a user's own service must not end the mission.
        refusal = "" if getattr(answered, "success", True) else str(getattr(answered, "message", ""))
        by, reason = author
        order = {"verb": verb.name, "label": verb.label, "by": by, "reason": reason, "refusal": refusal}
        self._journal.record_observation(ORDERED, **order, is_told=bool(noted))
        return answered


def escape_to_single_line(text: str) -> str:
    """Return untrusted text for use in a sentence: one line, shortened, without a full stop."""
    return "".join(filter(str.isprintable, text))[:_LONGEST].strip().removesuffix(".")


class RemoteCommandAuthor:
    """Announces the author of a command to a mission in another process.

    Args:
        node: The node that calls.
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
        """Announce the author of a command; after the response, run *then*, which calls the command's service.

        A node without parameters gets no announcement. If the response is lost, which happens when two nodes have just discovered each other, the
        command is delayed, but still sent, unless it has an object: then it might be carried out on another one, and *refuse* is called with the
        reason.
        """
        from rclpy.parameter import Parameter

        from sar_compiler.ros.clock import steady_timer

        def send(*, is_heard: bool) -> None:
            if is_heard or not seen:
                then()
            else:
                refuse(
                    "the mission has not confirmed the object of the command, so it was not sent. Repeat it"
                )

        if not self._client.service_is_ready():
            send(is_heard=False)
            return

        def call_service(answered: Any = None) -> None:
            if not timer.is_canceled():
                timer.cancel()
                self._node.destroy_timer(timer)
                send(is_heard=answered is not None and _is_accepted(answered))

        timer = steady_timer(self._node, _HEARD_SEC, call_service)
        request = self._client.srv_type.Request()
        announced = [*author, *([json_text(dict(seen))] if seen else [])]
        request.parameters = [Parameter(f"{_PARAMETER}.{verb}", value=announced).to_parameter_msg()]
        self._client.call_async(request).add_done_callback(call_service)


def _is_accepted(answered: Any) -> bool:
    try:
        return all(each.successful for each in answered.result().results)
    except Exception:  # noqa: BLE001 - a failing call raises arbitrary exceptions
        return False
