"""By whom the orders to a mission are given, and why: said before each call of a service, and written into the journal with it."""

import time
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from functools import partial
from inspect import iscoroutinefunction
from typing import TYPE_CHECKING, Any

from sar_compiler.journal.journal_entries import ORDERED, CommandAuthor
from sar_compiler.missions.mission import Verb

if TYPE_CHECKING:
    from rcl_interfaces.msg import SetParametersResult
    from rclpy.node import Node
    from rclpy.parameter import Parameter

    from sar_compiler.journal.journal import Journal

# The services of orders have no field for it, so that `std_srvs/srv/Trigger` is enough and every order takes it in one way: who is about to call
# `~/pause` sets the parameter `ordered_by.pause` of its node, to a name, or to a name and a reason.
_PARAMETER = "ordered_by"
_A_CALL = "a service call"
# How long somebody may take from there to the call, in seconds of the steady clock, and how long what they say may be.
_SIGNED_SEC, _LONGEST = 10.0, 200
# How long whoever is told may take to say that it was heard, likewise.
_HEARD_SEC = 1.0


class OrderRecord:
    """Writes each order to a mission into its journal, with its author.

    Args:
        node: The mission's node.
        verbs: What can be ordered of it.
        journal: Its journal.
    """

    def __init__(self, node: "Node", verbs: Sequence[Verb], journal: "Journal") -> None:
        self._node, self._journal = node, journal
        self._verbs = {verb.name: verb for verb in verbs}
        self._signed: defaultdict[str, deque[tuple[CommandAuthor, float]]] = defaultdict(deque)
        node.add_on_set_parameters_callback(self._hear)

    def begin(self) -> None:
        """Record from now on; the leaves have made the services."""
        names = {self._node.resolve_service_name(f"~/{name}"): verb for name, verb in self._verbs.items()}
        for service in self._node.services:
            verb = names.get(service.service_name)
            if verb is not None and not iscoroutinefunction(service.callback):
                service.callback = partial(self._carry_out, verb, service.callback)

    def sign(self, verb: str, author: CommandAuthor, then: Callable[[], object]) -> None:
        """Record who is about to call a verb's service, and call *then*, which does."""
        self._signed[verb].append((CommandAuthor(*map(one_line, author)), time.monotonic()))
        then()

    def _signature(self, verb: str) -> CommandAuthor:
        """Return who is calling a verb's service."""
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

    def _carry_out(self, verb: Verb, answer: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        author = self._signature(verb.name)
        with self._journal.ordered_by(author) as noted:
            answered = answer(request, response)
        # Whatever somebody's own service answers ends no mission.
        refusal = "" if getattr(answered, "success", True) else str(getattr(answered, "message", ""))
        by, reason = author
        order = {"verb": verb.name, "label": verb.label, "by": by, "reason": reason, "refusal": refusal}
        self._journal.watch(ORDERED, **order, is_told=bool(noted))
        return answered


def one_line(text: str) -> str:
    """Return a stranger's text as part of a sentence: one line, not too long, without a full stop."""
    return "".join(filter(str.isprintable, text))[:_LONGEST].strip().removesuffix(".")


class RemoteSignature:
    """Says to a mission in another process who is about to give an order.

    Args:
        node: The node that calls.
        of: The full name of the mission's node.
    """

    def __init__(self, node: "Node", of: str) -> None:
        from rcl_interfaces.srv import SetParameters

        self._node = node
        self._client: Any = node.create_client(SetParameters, f"{of}/set_parameters")

    def sign(self, verb: str, author: CommandAuthor, then: Callable[[], object]) -> None:
        """Say who is about to call a verb's service, and call *then*, which does, once that was heard.

        A node that takes no parameters is not told. An answer that is lost, as may happen where two nodes have just found each other, delays the
        order, and does not keep it from being given.
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
