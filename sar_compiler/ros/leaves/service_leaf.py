"""Calls of a ROS service: the base class of leaves, and a single call, without blocking."""

from abc import abstractmethod
from typing import TYPE_CHECKING, Any, cast

from py_trees.common import Status

from sar_compiler.ros.leaves.client_leaf import ClientLeaf, Exchange
from sar_compiler.ros.leaves.leaf import alive

if TYPE_CHECKING:
    from rclpy.client import Client
    from rclpy.task import Future


class ServiceCall(Exchange):
    """One request, sent at most once, and its answer.

    Args:
        leaf: The leaf that calls; hears the answer when it arrives, unless the call has been given up.
        client: The service's client.
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
        self._future.add_done_callback(self._take)

    def _withdraw(self) -> None:
        if self._future is not None:
            # Without this the client would wait for the answer, and keep the request, for good.
            self._client.remove_pending_request(self._future)

    def _take(self, future: "Future") -> None:
        # The answer may have been on its way to this callback when the call was given up.
        if not self._abandoned:
            self.answer = future.result()
            self._leaf._hear(self.answer)


class ServiceLeaf(ClientLeaf[ServiceCall]):
    """A leaf that makes one call of a service in each activation; RUNNING until the answer comes.

    A subclass has the attributes `service_type` and `service_name`, of the class or set by its constructor, and
    the methods `request` and, if the content of the answer matters, `on_response`.

    Attributes:
        service_type: `"package/srv/Name"`, or the Python class.
        service_name: The service's (relative) name.
        server_timeout_sec: How long to wait for a server, seconds.
        timeout_sec: How long to wait for the answer, seconds.
        interface: The Python class of the service, once the leaf is set up.

    Example:
        A leaf that opens the gripper, FAILURE if the server says so::

            class OpenGripper(ServiceLeaf):
                service_type = "std_srvs/srv/Trigger"
                service_name = "gripper/open"

                def request(self) -> Any:
                    return self.interface.Request()
    """

    service_type: Any = None
    service_name: str = ""
    timeout_sec: float = 5.0

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._client: Client | None = None

    @abstractmethod
    def request(self) -> Any:
        """Return the request, an `interface.Request`.

        Or a `Status`, to send nothing: SUCCESS and FAILURE end the leaf, with RUNNING this method is called again at
        the next tick.
        """

    def on_response(self, response: Any) -> Status:
        """Return the leaf's status for the answer; with RUNNING the service is called again, with a new `request`.

        By default SUCCESS, or FAILURE if the response has a field `success`, as in std_srvs, that is false.
        """
        if getattr(response, "success", True):
            return Status.SUCCESS
        return self.on_failure(getattr(response, "message", "") or "the server says that it did not succeed")

    def is_good_news(self, response: Any) -> bool:
        """Return whether the tree is ticked at once after an answer, instead of at the next period.

        After a bad answer a tree may call again at once, which would repeat as fast as the machine allows.
        """
        return bool(getattr(response, "success", True))

    def shutdown(self) -> None:
        """Give the call up and release the client, which is gone already if the node is."""
        self._drop()
        self._disconnect()
        super().shutdown()

    def _server(self) -> tuple[str, str, Any]:
        return "srv", self.service_name, self.service_type

    def _connect(self) -> None:
        self._client = self.node.create_client(self.interface, self.service_name)

    def _disconnect(self) -> None:
        if self._client is not None and alive(self.node):
            self.node.destroy_client(self._client)
        self._client = None

    def _progress(self, exchange: ServiceCall) -> Status:
        status = super()._progress(exchange)
        if exchange.sent and exchange.trouble:
            # A server that has not found the client's reader drops every answer to it; it may find another one's.
            self._disconnect()
            self._connect()
        return status

    def _message(self) -> Any:
        return self.request()

    def _open(self, message: Any) -> ServiceCall:
        return ServiceCall(self, cast("Client", self._client), message)

    def _conclude(self, answer: Any) -> Status:
        return self.on_response(answer)

    def _hear(self, answer: Any) -> None:
        self._complaints.clear()
        if self.is_good_news(answer):
            self._wake()
