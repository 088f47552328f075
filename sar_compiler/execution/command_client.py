"""Client for the operator's commands, for threads other than the mission's."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any, Protocol

from sar_compiler.journal.command_objects import SeenObjects
from sar_compiler.journal.journal_entries import CommandAuthor
from sar_compiler.missions.mission import CommandError, OperatorCommand
from sar_compiler.ros.leaves.leaf import find_interface

if TYPE_CHECKING:
    from rclpy.node import Node

_UNKNOWN = CommandAuthor()
_NOTHING_SEEN: SeenObjects = {}


class Sign(Protocol):
    """Announces a command to its mission."""

    def __call__(
        self,
        verb: str,
        author: CommandAuthor,
        then: Callable[[], object],
        seen: SeenObjects = ...,
        refuse: Callable[[str], object] = ...,
        /,
    ) -> object:
        """Announce a command, its author and the objects that they saw; call *then*, which sends it, or *refuse* with the reason."""
        ...


def _send_at_once(
    _verb: str,
    _author: CommandAuthor,
    then: Callable[[], object],
    _seen: SeenObjects = _NOTHING_SEEN,
    _refuse: object = None,
) -> None:
    then()


class CommandClient:
    """Calls the services of a mission's commands, from any thread, in the node's executor.

    Args:
        node: The node that calls; by default the mission's own, which also has the services.
        verbs: The commands.
        sign: Called in the executor's thread with a command.
        of: The name of the mission's node.
    """

    def __init__(
        self,
        node: "Node",
        verbs: Sequence[OperatorCommand],
        sign: Sign = _send_at_once,
        of: str = "~",
    ) -> None:
        self._sign = sign
        self._verbs = {verb.name: verb for verb in verbs}
        types = {
            verb.name: find_interface("OperatorCommand", "srv", verb.name, verb.service_type)
            for verb in verbs
        }
        self._clients = {name: node.create_client(kind, f"{of}/{name}") for name, kind in types.items()}
        self._waiting: deque[Callable[[], None]] = deque()
        self._node = node

    def available(self) -> list[str]:
        """Return the commands that the tree's leaves execute."""
        return [name for name, client in self._clients.items() if client.service_is_ready()]

    def send(
        self,
        verb: str,
        values: Mapping[str, Any],
        author: CommandAuthor = _UNKNOWN,
        seen: SeenObjects = _NOTHING_SEEN,
    ) -> "Future[tuple[bool, str]]":
        """Send a command, from any thread.

        Args:
            verb: The name of a command.
            values: The values that come with it.
            author: Its author and reason.
            seen: What they saw; the mission refuses the command if it has changed.

        Returns:
            Whether it was accepted, with the response's message; it can be cancelled until it is sent.

        Raises:
            CommandError: If the command is unknown, a value is wrong, or no leaf of the tree executes it.
        """
        known = self._verbs.get(verb)
        if known is None:
            raise CommandError(f"unknown command {verb!r:.60}")
        checked = known.check(values)
        client = self._clients[verb]
        if not client.service_is_ready():
            raise CommandError(f"no node of this tree executes '{verb}'")
        request = client.srv_type.Request()
        known.fill(request, checked)
        answer: Future[tuple[bool, str]] = Future()
        self._waiting.append(lambda: self._send(known, client, request, answer, author, seen))
        # With an executor of its own, the services exist once the tree is set up.
        from sar_compiler.ros.executors import call_soon

        call_soon(self._node.executor, self._call)
        return answer

    def _call(self) -> None:
        while self._waiting:
            self._waiting.popleft()()

    def _send(
        self,
        verb: OperatorCommand,
        client: Any,
        request: Any,
        answer: "Future[tuple[bool, str]]",
        author: CommandAuthor,
        seen: SeenObjects,
    ) -> None:
        # The caller of a cancelled command was told that it is not executed; from here on it can no longer be cancelled.
        if not answer.set_running_or_notify_cancel():
            return
        self._sign(
            verb.name,
            author,
            lambda: self._call_service(client, request, answer),
            seen,
            lambda reason: answer.set_result((False, reason)),
        )

    def _call_service(self, client: Any, request: Any, answer: "Future[tuple[bool, str]]") -> None:
        def on_response(called: Any) -> None:
            try:
                response = called.result()
                said = bool(response.success), str(response.message)
            except Exception as error:  # noqa: BLE001 - a failing call must not end the mission
                answer.set_exception(CommandError(f"the command got no response: {error}"))
                return
            answer.set_result(said)

        try:
            called = client.call_async(request)
        except Exception as error:  # noqa: BLE001 - rclpy raises arbitrary exceptions on values
            answer.set_exception(CommandError(f"the command cannot be sent: {error}"))
            return
        called.add_done_callback(on_response)
