"""A client for operator commands. Any thread may use the client."""

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
    """Announces a command to the mission before the command is sent."""

    def __call__(
        self,
        verb: str,
        author: CommandAuthor,
        then: Callable[[], object],
        seen: SeenObjects = ...,
        refuse: Callable[[str], object] = ...,
        /,
    ) -> object:
        """Announce a command; then call *then* to send the command, or *refuse* with the reason for not sending it."""
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
    """Sends a mission's commands: any thread may request a command, and the node's executor calls the service.

    Args:
        node: The node that calls the services.
        verbs: The mission's commands.
        sign: Announces each command; called in the executor's thread.
        of: The name of the mission's node; by default *node* itself.
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
        """Return the names of the commands whose services are available."""
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
            verb: The command's name.
            values: The values of the command's fields, by name.
            author: The command's author and reason.
            seen: The objects that the author saw; the mission refuses the command if one of them has changed.

        Returns:
            A future for a pair: whether the command was accepted, and the message of the response. The future can be cancelled until the
            command is sent.

        Raises:
            CommandError: If the command is unknown, a value is invalid, or no leaf of the tree executes the command.
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
        # The services are created when the tree is set up, so the node has an executor by now.
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
        # A cancelled command is not sent, because its caller assumes so. From here on the command can no longer be cancelled.
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
