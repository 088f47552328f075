"""The base class of all leaves that call a server, and the base class of leaves that call a service."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, cast

from py_trees.common import Status

from sar_compiler.ros.clock import Deadline, deadline_clock
from sar_compiler.ros.graph_queries import explain_absence
from sar_compiler.ros.leaves.leaf import (
    LeafDefinitionError,
    MissingNodeError,
    RosLeaf,
    find_interface,
    is_node_valid,
)
from sar_compiler.runtime.clock import Clock, WallClock

if TYPE_CHECKING:
    from rclpy.client import Client
    from rclpy.task import Future


class PendingCall(ABC):
    """A goal or a service call that receives at most one final response.

    Args:
        leaf: The leaf that sends the message. The leaf defines the time limits and their clock, and is notified of the response.
        server: The name of the action or service.
        reply_sec: The maximum wait for the first reply after the message was sent, in seconds.

    Attributes:
        sent: Whether the message was sent.
        answer: The server's final response; None before it arrives.
        trouble: The reason why no final response will arrive; empty while a response is still possible.
    """

    _server_kind: ClassVar[str]
    _reply: ClassVar[str]

    def __init__(self, leaf: "ClientLeaf[Any]", server: str, reply_sec: float) -> None:
        self.sent = False
        self.answer: Any = None
        self.trouble = ""
        self._leaf, self._server, self._reply_sec = leaf, server, reply_sec
        self._deadline = self._limit(leaf.server_timeout_sec)
        self._abandoned = False

    @property
    def is_over(self) -> bool:
        """Whether the call has ended, with or without success."""
        return self.answer is not None or bool(self.trouble)

    def poll(self) -> None:
        """Send the message as soon as the server is ready, and check the time limits."""
        if self.is_over or self._abandoned:
            return
        if self.sent:
            self._watch()
        elif self._server_is_ready():
            # The message is only sent to a server that is ready, because it would not be delivered to a server that appears later.
            self._leaf._announce()
            self.sent = True
            self._deadline = self._limit(self._reply_sec)
            self._send()
        elif self._deadline.has_passed:
            there = explain_absence(self._leaf.node, self._leaf, self._server_kind, self._server)
            self._give_up(
                f"no server for the {self._server_kind} '{self._server}' within {self._leaf.server_timeout_sec:g} s{there}"
            )

    def abandon(self) -> None:
        """Abandon the call; later responses are ignored."""
        if self.is_over or self._abandoned:
            return
        self._abandoned = True
        if self.sent:
            self._cancel_sent()

    @abstractmethod
    def _server_is_ready(self) -> bool:
        """Return whether a server would receive the message."""

    @abstractmethod
    def _send(self) -> None:
        """Send the message."""

    @abstractmethod
    def _cancel_sent(self) -> None:
        """Cancel the goal or the pending request after it was sent."""

    def _watch(self) -> None:
        """Fail if the first reply has not arrived within the limit."""
        if self._deadline.has_passed:
            self._give_up(
                f"{self._reply} within {self._reply_sec:g} s. "
                f"Check whether the server of '{self._server}' is running and not overloaded"
            )

    def _give_up(self, trouble: str) -> None:
        self.abandon()
        self.trouble = trouble

    def _limit(self, seconds: float) -> Deadline:
        return Deadline(seconds, self._leaf._clock)


E = TypeVar("E", bound=PendingCall)


class ClientLeaf(RosLeaf, Generic[E]):
    """A leaf that calls a server once in each activation, and never blocks.

    The leaf keeps its final status until the next activation.

    Attributes:
        server_timeout_sec: The maximum wait for a server, in seconds. All time limits use simulated time if the node uses it, otherwise the
            machine's time (`clock.deadline_clock`).
    """

    server_timeout_sec: float = 10.0

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._interface: Any = None
        self._exchange: E | None = None
        self._verdict = Status.INVALID
        self._complaints: set[str] = set()
        self._clock: Clock = WallClock()

    @property
    def interface(self) -> Any:
        """The Python class of the action or service.

        Raises:
            MissingNodeError: If the leaf was not set up, or has been shut down.
        """
        self._require_setup()
        return self._interface

    def setup(self, **kwargs: Any) -> None:
        """Create the client, without waiting for a server.

        Args:
            **kwargs: `node`, and optionally `wake` (see `RosLeaf`).

        Raises:
            LeafDefinitionError: If the class does not define the server's name, or the type is not installed.
        """
        self.shutdown()
        super().setup(**kwargs)
        self._clock = deadline_clock(self.node)
        self._interface = find_interface(type(self).__name__, *self._server())
        self._connect()

    def initialise(self) -> None:
        """Abandon the call of the last activation, and start a new call."""
        self._drop()
        self._verdict = self._begin()

    def update(self) -> Status:
        """Return the leaf's status: RUNNING until the server has responded or the call has failed."""
        if self._verdict is Status.RUNNING:
            self._verdict = self._begin() if self._exchange is None else self._progress(self._exchange)
        return self._verdict

    def terminate(self, new_status: Status) -> None:
        """Abandon the current call if the leaf was interrupted."""
        if new_status is Status.INVALID:
            self._drop()

    def shutdown(self) -> None:
        """Abandon the current call, and release the node."""
        self._drop()
        self._interface = None
        super().shutdown()

    def warn(self, text: str) -> None:
        """Log a warning, and set it as the feedback message.

        The same warning is logged again only after the server has responded, because a tree may call the server in every tick.
        """
        self.feedback_message = text
        if text not in self._complaints:
            self._complaints.add(text)
            super().warn(text)

    def on_send(self) -> None:
        """Hook called before the message is sent, for example to log the call."""

    def on_failure(self, reason: str) -> Status:
        """Handle a missing response, or a response that reports a failure: log a warning and return FAILURE.

        Args:
            reason: The cause, such as a missing server, a late response, or a goal that was rejected or aborted.
        """
        self.warn(f"'{self.name}' failed: {reason}")
        return Status.FAILURE

    @abstractmethod
    def _server(self) -> tuple[str, str, Any]:
        """Return the kind of the interface (`action` or `srv`), the server's name, and the interface's type."""

    @abstractmethod
    def _connect(self) -> None:
        """Create the client."""

    @abstractmethod
    def _message(self) -> Any:
        """Return the message to send, or a status if no message is to be sent."""

    @abstractmethod
    def _open(self, message: Any) -> E:
        """Create the call that sends a message."""

    @abstractmethod
    def _conclude(self, answer: Any) -> Status:
        """Return the leaf's status after the final response; return RUNNING to call the server again."""

    def _require_setup(self) -> None:
        if self._interface is None:
            raise MissingNodeError(self.name, type(self).__name__)

    def _begin(self) -> Status:
        self._exchange = None
        self._require_setup()
        message = self._message()
        if isinstance(message, Status):
            return message
        kind, name, _ = self._server()
        wanted = "Goal" if kind == "action" else "Request"
        if not isinstance(message, getattr(self.interface, wanted)):
            problem = f"{type(self).__name__}.{wanted.lower()}() returned {message!r}"
            raise LeafDefinitionError(f"{problem}. Return an interface.{wanted}, or a Status to send nothing")
        self._exchange = self._open(message)
        self._exchange.poll()
        if not self._exchange.sent and not self._exchange.trouble:
            self.feedback_message = f"waiting for a server of '{name}'"
            self.log(f"Waiting for the {'service' if kind == 'srv' else 'action server'} {name}...")
        return Status.RUNNING

    def _progress(self, exchange: E) -> Status:
        exchange.poll()
        return self._judge(exchange)

    def _judge(self, exchange: E) -> Status:
        if exchange.trouble:
            return self.on_failure(self._explain(exchange))
        if exchange.answer is None:
            return Status.RUNNING
        self.feedback_message = ""
        status = self._conclude(exchange.answer)
        return self._begin() if status is Status.RUNNING else status

    def _explain(self, exchange: E) -> str:
        return exchange.trouble

    def _announce(self) -> None:
        self.feedback_message = self._waits
        self.on_send()

    @property
    def _waits(self) -> str:
        return f"waiting for '{self._server()[1]}'"

    def _drop(self) -> None:
        if self._exchange is not None:
            self._exchange.abandon()
            self._exchange = None
        if self._verdict is Status.RUNNING:
            self._verdict = Status.FAILURE


class ServiceCall(PendingCall):
    """A call of a service: one request and its response.

    Args:
        leaf: The leaf that calls the service. The leaf is notified of the response, unless the call has been abandoned.
        client: The client of the service.
        request: The request to send.
    """

    _server_kind = "service"
    _reply = "no answer"

    _leaf: "ServiceLeaf"

    def __init__(self, leaf: "ServiceLeaf", client: "Client", request: Any) -> None:
        super().__init__(leaf, client.srv_name, leaf.timeout_sec)
        self._client, self._request = client, request
        self._future: Future | None = None

    def _server_is_ready(self) -> bool:
        return bool(self._client.context.ok() and self._client.service_is_ready())

    def _send(self) -> None:
        self._future = self._client.call_async(self._request)
        self._future.add_done_callback(self._on_future_done)

    def _cancel_sent(self) -> None:
        if self._future is not None:
            # Otherwise the client would store the request and wait for the response forever.
            self._client.remove_pending_request(self._future)

    def _on_future_done(self, future: "Future") -> None:
        # The call of this method may have been scheduled before the service call was abandoned.
        if not self._abandoned:
            self.answer = future.result()
            self._leaf._on_response(self.answer)


class ServiceLeaf(ClientLeaf[ServiceCall]):
    """A leaf that calls a service once in each activation, and is RUNNING until the response arrives.

    A subclass sets the attributes `service_type` and `service_name`, in the class or its constructor. It defines the method
    `request` and, if the content of the response matters, `on_response`.

    Attributes:
        service_type: `"package/srv/Name"`, or the Python class.
        service_name: The (relative) name of the service.
        server_timeout_sec: The maximum wait for a server, in seconds.
        timeout_sec: The maximum wait for the response, in seconds.
        interface: The Python class of the service; available after the leaf's setup.

    Example:
        A leaf that opens the gripper, and returns FAILURE if the server reports a failure::

            class OpenGripper(ServiceLeaf):
                service_type = "std_srvs/srv/Trigger"
                service_name = "gripper/open"

                def request(self) -> Any:
                    return self.interface.Request()
    """

    required_attributes: ClassVar[Mapping[str, str]] = {
        "service_type": "std_srvs/srv/Trigger",
        "service_name": "gripper/open",
    }
    """The attributes that a subclass must set, in the class or in its constructor, each with an example. `checks.leaf_classes` checks these
    attributes.
    """
    use_kind: ClassVar[str] = "service"
    """The kind of the `Use` with which a leaf is registered."""
    service_type: Any = None
    service_name: str = ""
    timeout_sec: float = 5.0

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._client: Client | None = None

    @abstractmethod
    def request(self) -> Any:
        """Return the request to send, an `interface.Request`.

        To send no request, return a `Status`: SUCCESS and FAILURE end the leaf. After RUNNING, this method is called again in
        the next tick.
        """

    def on_response(self, response: Any) -> Status:
        """Return the leaf's status after the response; return RUNNING to call the service with a new `request`.

        By default, the status is FAILURE if the response has a field `success` (as in std_srvs) and this field is false. Otherwise the
        status is SUCCESS.
        """
        if getattr(response, "success", True):
            return Status.SUCCESS
        return self.on_failure(getattr(response, "message", "") or "the server reports a failure")

    def is_good_news(self, response: Any) -> bool:
        """Return whether a response triggers an immediate tick.

        By default, a response that reports a failure does not trigger a tick. Otherwise a tree that calls the service again at once would
        repeat the call as fast as the machine allows.
        """
        return bool(getattr(response, "success", True))

    def shutdown(self) -> None:
        """Abandon the current call, and destroy the client."""
        self._drop()
        self._disconnect()
        super().shutdown()

    def _server(self) -> tuple[str, str, Any]:
        return "srv", self.service_name, self.service_type

    def _connect(self) -> None:
        self._client = self.node.create_client(self.interface, self.service_name)

    def _disconnect(self) -> None:
        if self._client is not None and is_node_valid(self.node):
            self.node.destroy_client(self._client)
        self._client = None

    def _progress(self, exchange: ServiceCall) -> Status:
        status = super()._progress(exchange)
        if exchange.sent and exchange.trouble:
            # A server that has not discovered this client's reader drops every response. It may discover the reader of a new client.
            self._disconnect()
            self._connect()
        return status

    def _message(self) -> Any:
        return self.request()

    def _open(self, message: Any) -> ServiceCall:
        return ServiceCall(self, cast("Client", self._client), message)

    def _conclude(self, answer: Any) -> Status:
        return self.on_response(answer)

    def _on_response(self, answer: Any) -> None:
        self._complaints.clear()
        if self.is_good_news(answer):
            self._wake()
