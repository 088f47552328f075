"""Carrying out the operator's orders from another thread than the mission's."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any

from sar_compiler.journal.journal_entries import CommandAuthor
from sar_compiler.missions.mission import Verb, VerbError
from sar_compiler.ros.leaves.leaf import find_interface

if TYPE_CHECKING:
    from rclpy.node import Node

_UNKNOWN = CommandAuthor()


class VerbCalls:
    """Calls the services of a mission's verbs: ordered from any thread, called in that of the node's executor.

    Args:
        node: The node that calls; by default it is the mission's, which has the services as well.
        verbs: What can be ordered.
        sign: Is called with a verb, whoever has ordered it, and what calls the service once that is known; in the executor's thread.
        of: The name of the mission's node.
    """

    def __init__(
        self,
        node: "Node",
        verbs: Sequence[Verb],
        sign: Callable[[str, CommandAuthor, Callable[[], None]], object] = lambda _verb, _author, then: (
            then()
        ),
        of: str = "~",
    ) -> None:
        self._sign = sign
        self._verbs = {verb.name: verb for verb in verbs}
        types = {verb.name: find_interface("Verb", "srv", verb.name, verb.service_type) for verb in verbs}
        self._clients = {name: node.create_client(kind, f"{of}/{name}") for name, kind in types.items()}
        self._waiting: deque[Callable[[], None]] = deque()
        self._node = node

    def available(self) -> list[str]:
        """Return the verbs whose services are there: those that the tree's leaves heed."""
        return [name for name, client in self._clients.items() if client.service_is_ready()]

    def give(
        self, verb: str, values: Mapping[str, Any], author: CommandAuthor = _UNKNOWN
    ) -> "Future[tuple[bool, str]]":
        """Give an order, from any thread.

        Args:
            verb: The name of a verb.
            values: The values that come with it.
            author: Who orders it, and why.

        Returns:
            Whether it was accepted, and what was said to it; it can be cancelled until it is sent.

        Raises:
            VerbError: If there is no such verb, or a value is wrong, or no leaf of the tree heeds it.
        """
        known = self._verbs.get(verb)
        if known is None:
            raise VerbError(f"there is no order {verb!r:.60}")
        checked = known.check(values)
        client = self._clients[verb]
        if not client.service_is_ready():
            raise VerbError(f"no node of this tree heeds '{verb}'")
        request = client.srv_type.Request()
        known.fill(request, checked)
        answer: Future[tuple[bool, str]] = Future()
        self._waiting.append(lambda: self._send(known, client, request, answer, author))
        # It has an executor: the services are there once the tree is set up.
        from sar_compiler.ros.executors import call_soon

        call_soon(self._node.executor, self._call)
        return answer

    def _call(self) -> None:
        while self._waiting:
            self._waiting.popleft()()

    def _send(
        self,
        verb: Verb,
        client: Any,
        request: Any,
        answer: "Future[tuple[bool, str]]",
        author: CommandAuthor,
    ) -> None:
        # Whoever has given up an order has been told that it was not carried out; from here on nobody can.
        if not answer.set_running_or_notify_cancel():
            return
        self._sign(verb.name, author, lambda: self._call_service(client, request, answer))

    def _call_service(self, client: Any, request: Any, answer: "Future[tuple[bool, str]]") -> None:
        def take(called: Any) -> None:
            try:
                response = called.result()
                said = bool(response.success), str(response.message)
            except Exception as error:  # noqa: BLE001 - what a client comes to must not end the mission
                answer.set_exception(VerbError(f"the order was not answered: {error}"))
                return
            answer.set_result(said)

        try:
            called = client.call_async(request)
        except Exception as error:  # noqa: BLE001 - rclpy raises whatever a value is to it
            answer.set_exception(VerbError(f"the order cannot be sent: {error}"))
            return
        called.add_done_callback(take)
