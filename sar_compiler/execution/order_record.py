"""Author and reason of the operator's commands: announced before each service call, and recorded with it in the journal."""

import time
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from functools import partial
from inspect import iscoroutinefunction
from typing import TYPE_CHECKING, Any

from sar_compiler.journal.journal_entries import ORDERED, CommandAuthor
from sar_compiler.missions.mission import OperatorCommand

if TYPE_CHECKING:
    from rcl_interfaces.msg import SetParametersResult
    from rclpy.node import Node
    from rclpy.parameter import Parameter

    from sar_compiler.journal.journal import Journal

# The services of commands have no field for the author, so that `std_srvs/srv/Trigger` suffices and all commands work alike. Before a client
# calls `~/pause`, it sets the parameter `ordered_by.pause` of the node to a name, or to a name and a reason.
_PARAMETER = "ordered_by"
_A_CALL = "a service call"
# Longest time from the announcement to the call, in seconds of the steady clock, and longest text.
_SIGNED_SEC, _LONGEST = 10.0, 200
# Longest wait for the mission's response to the announcement, in the same units.
_HEARD_SEC = 1.0


class OrderRecord:
    """Records each command to a mission in its journal, with its author.

    Args:
        node: The mission's node.
        verbs: The mission's commands.
        journal: Its journal.
    """

    def __init__(self, node: "Node", verbs: Sequence[OperatorCommand], journal: "Journal") -> None:
        self._node, self._journal = node, journal
        self._verbs = {verb.name: verb for verb in verbs}
        self._signed: defaultdict[str, deque[tuple[CommandAuthor, float]]] = defaultdict(deque)
        node.add_on_set_parameters_callback(self._hear)

    def begin(self) -> None:
        """Start recording; the leaves have already created the services."""
        names = {self._node.resolve_service_name(f"~/{name}"): verb for name, verb in self._verbs.items()}
        for service in self._node.services:
            verb = names.get(service.service_name)
            if verb is not None and not iscoroutinefunction(service.callback):
                service.callback = partial(self._carry_out, verb, service.callback)

    def sign(self, verb: str, author: CommandAuthor, then: Callable[[], object]) -> None:
        """Store the author of the next call of a command's service, then run *then*, which calls it."""
        self._signed[verb].append((CommandAuthor(*map(one_line, author)), time.monotonic()))
        then()

    def _signature(self, verb: str) -> CommandAuthor:
        """Return the author of the current call of a command's service."""
        signed, oldest = self._signed[verb], time.monotonic() - _SIGNED_SEC
        while signed:
            author, said = signed.popleft()
            if any(author) and said > oldest:
                return author._replace(name=author.name or _A_CALL)
        return CommandAuthor(_A_CALL)

    def _hear(self, parameters: "list[Parameter]") -> "SetParametersResult":
        from rcl_interfaces.msg import SetParametersResult

        for each in parameters:
            group, _, verb = each.name.partition(".")
            if group == _PARAMETER and verb in self._verbs:
                said = each.value if isinstance(each.value, list) else [each.value]
                self.sign(verb, CommandAuthor(*map(str, said[:2])), lambda: None)
        return SetParametersResult(successful=True)

    def _carry_out(
        self, verb: OperatorCommand, answer: Callable[[Any, Any], Any], request: Any, response: Any
    ) -> Any:
        author = self._signature(verb.name)
        with self._journal.ordered_by(author) as noted:
            answered = answer(request, response)
        # Any response of a user's own service must not end the mission.
        refusal = "" if getattr(answered, "success", True) else str(getattr(answered, "message", ""))
        by, reason = author
        order = {"verb": verb.name, "label": verb.label, "by": by, "reason": reason, "refusal": refusal}
        self._journal.watch(ORDERED, **order, is_told=bool(noted))
        return answered


def one_line(text: str) -> str:
    """Return untrusted text as part of a sentence: one line, limited in length, without a full stop."""
    return "".join(filter(str.isprintable, text))[:_LONGEST].strip().removesuffix(".")


class RemoteSignature:
    """Announces the author of a command to a mission in another process.

    Args:
        node: The node that calls.
        of: The full name of the mission's node.
    """

    def __init__(self, node: "Node", of: str) -> None:
        from rcl_interfaces.srv import SetParameters

        self._node = node
        self._client: Any = node.create_client(SetParameters, f"{of}/set_parameters")

    def sign(self, verb: str, author: CommandAuthor, then: Callable[[], object]) -> None:
        """Announce the author of the next call of a command's service, and run *then*, which calls it, after the response.

        A node without parameters gets no announcement. If the response is lost, which happens when two nodes have just discovered each other, the
        command is delayed, but still sent.
        """
        from rclpy.parameter import Parameter

        from sar_compiler.ros.clock import steady_timer

        if not self._client.service_is_ready():
            then()
            return

        def go_on(_: object = None) -> None:
            if not timer.is_canceled():
                timer.cancel()
                self._node.destroy_timer(timer)
                then()

        timer = steady_timer(self._node, _HEARD_SEC, go_on)
        request = self._client.srv_type.Request()
        request.parameters = [Parameter(f"{_PARAMETER}.{verb}", value=[*author]).to_parameter_msg()]
        self._client.call_async(request).add_done_callback(go_on)
