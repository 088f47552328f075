"""One call of a ROS service, without ever waiting; and the leaf that is one such call."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from py_trees.common import Status

from sar_compiler.ros.leaves.deadline import Deadline
from sar_compiler.ros.leaves.errors import MissingNodeError
from sar_compiler.ros.leaves.leaf import RosLeaf, alive

if TYPE_CHECKING:
    from rclpy.client import Client
    from rclpy.task import Future


@dataclass(frozen=True)
class CallDeadlines:
    """How long a call may take over what, in seconds of the machine's steady clock.

    Attributes:
        server_sec: Until there is a server.
        answer_sec: From the request to the answer.
    """

    server_sec: float
    answer_sec: float


class ServiceCall:
    """One request, sent at most once, and its answer.

    Args:
        client: The service's client.
        request: The request to send.
        deadlines: The limits to keep.
        on_sending: Called just before the request is sent.
        on_answer: Called with the answer when it arrives; not any more once the call was dropped.
    """

    def __init__(
        self,
        client: "Client",
        request: Any,
        deadlines: CallDeadlines,
        on_sending: Callable[[], None],
        on_answer: Callable[[Any], None],
    ) -> None:
        self.sent = False
        self.answer: Any = None
        self.trouble = ""
        self._client = client
        self._request = request
        self._deadlines = deadlines
        self._on_sending = on_sending
        self._on_answer = on_answer
        self._deadline = Deadline(deadlines.server_sec)
        self._future: Future | None = None
        self._dropped = False

    def advance(self) -> None:
        """Do what can be done now: send the request, or see whether a deadline has passed."""
        if self._dropped or self.answer is not None:
            return
        if self._future is None:
            self._send_or_wait()
        elif self._deadline.passed:
            self.drop()
            self.trouble = (
                f"no answer within {self._deadlines.answer_sec:g} s; "
                f"is the server of '{self._client.srv_name}' alive and not overloaded?"
            )

    def drop(self) -> None:
        """Give the call up: an answer that is still to come is ignored."""
        self._dropped = True
        if self._future is not None:
            # Without this the client would wait for the answer, and keep the request, for good.
            self._client.remove_pending_request(self._future)

    def _send_or_wait(self) -> None:
        if self._client.context.ok() and self._client.service_is_ready():
            # Sent to nobody, a request would be lost: it is not delivered to a server that appears later.
            self.sent = True
            self._deadline = Deadline(self._deadlines.answer_sec)
            self._on_sending()
            self._future = self._client.call_async(self._request)
            self._future.add_done_callback(self._take)
        elif self._deadline.passed:
            self.drop()
            self.trouble = (
                f"no server for the service '{self._client.srv_name}' within {self._deadlines.server_sec:g} s; "
                "is it running, and in this namespace?"
            )

    def _take(self, future: "Future") -> None:
        # The answer may have been on its way to this callback when the call was dropped.
        if not self._dropped:
            self.answer = future.result()
            self._on_answer(self.answer)


@dataclass(frozen=True)
class Question:
    """What a leaf asks.

    Attributes:
        request: The service's request.
        announcement: What the log says when the request is sent.
    """

    request: Any
    announcement: str


class ServiceLeaf(RosLeaf):
    """A leaf that makes one service call for each activation.

    Subclasses say which service, what to ask, and what the answer means.

    Args:
        name: The leaf's name in the tree.
        service: The service's (relative) name.
        deadlines: How long the call may take.
    """

    def __init__(self, name: str, service: str, deadlines: CallDeadlines) -> None:
        super().__init__(name)
        self._service = service
        self._deadlines = deadlines
        self._client: Client | None = None
        self._call: ServiceCall | None = None
        self._verdict = Status.INVALID

    def setup(self, **kwargs: Any) -> None:
        """Make the service's client; does not wait for a server.

        Args:
            **kwargs: `node` and optionally `wake`, see `RosLeaf`.
        """
        self.shutdown()
        super().setup(**kwargs)
        self._client = self.node.create_client(self._service_type(), self._service)

    def initialise(self) -> None:
        """Start one call."""
        self._drop_call()
        self._verdict = Status.RUNNING
        question = self._ask()
        if question is None:
            self._verdict = Status.FAILURE
            return
        self._call = self._make_call(question)
        self._call.advance()
        if not self._call.sent and not self._call.trouble:
            self.feedback_message = f"waiting for a server of '{self._service}'"
            self.say(f"Waiting for the service {self._service}...")

    def update(self) -> Status:
        """Say how the call stands."""
        call = self._call
        if self._verdict is Status.RUNNING and call is not None:
            call.advance()
            if call.answer is not None:
                self._verdict = self._conclude(call.answer)
            elif call.trouble:
                self.complain(f"'{self.name}' failed: {call.trouble}")
                self._verdict = Status.FAILURE
        return self._verdict

    def terminate(self, new_status: Status) -> None:
        """Drop the call if the leaf was interrupted."""
        if new_status is Status.INVALID:
            self._drop_call()

    def shutdown(self) -> None:
        """Drop the call and release the client; where the node is gone, so is the client."""
        self._drop_call()
        if self._client is not None:
            if alive(self.node):
                self.node.destroy_client(self._client)
            self._client = None
        super().shutdown()

    @abstractmethod
    def _service_type(self) -> Any:
        """Return the service's Python type."""

    @abstractmethod
    def _ask(self) -> Question | None:
        """Return what to ask, or None (and say why) if there is nothing to ask."""

    @abstractmethod
    def _conclude(self, answer: Any) -> Status:
        """Keep the answer, and say what it means."""

    def _is_good_news(self, answer: Any) -> bool:  # noqa: ARG002 - most answers are
        return True

    def _make_call(self, question: Question) -> ServiceCall:
        if self._client is None:
            raise MissingNodeError(self.name, type(self).__name__)

        def announce() -> None:
            # Before the server can say anything about it.
            self.feedback_message = f"waiting for the answer of '{self._service}'"
            self.say(question.announcement)

        return ServiceCall(self._client, question.request, self._deadlines, announce, self._hear)

    def _hear(self, answer: Any) -> None:
        if self._is_good_news(answer):
            self._wake()

    def _drop_call(self) -> None:
        if self._call is not None:
            self._call.drop()
            self._call = None
        if self._verdict is Status.RUNNING:
            self._verdict = Status.FAILURE
