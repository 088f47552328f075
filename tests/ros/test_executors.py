"""Tests of the choice of the executor that runs a mission's callbacks."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.waiting import SILENCE_SEC

pytestmark = pytest.mark.ros


class ServedNode:
    """A node with an events executor."""

    def __init__(self) -> None:
        from rclpy.context import Context
        from rclpy.node import Node

        from sar_compiler.ros.executors import make_executor

        pytest.importorskip("rclpy.experimental", reason="an rclpy without EventsExecutor")
        self.context = Context()
        self.context.init(initialize_logging=False)
        self.node = Node("served_node", context=self.context)
        self.executor: Any = make_executor(self.context, "events")
        self.executor.add_node(self.node)

    def select_executor(self) -> str:
        """Replace the executor if another one is needed for the node; return its class name."""
        from sar_compiler.ros.executors import suitable_executor

        self.executor = suitable_executor(self.executor, self.node)
        return type(self.executor).__name__

    def spin_until(self, condition: Callable[[], object], what: str) -> None:
        deadline = time.monotonic() + SILENCE_SEC
        while not condition():
            assert time.monotonic() < deadline, f"did not come: {what}"
            self.executor.spin_once(timeout_sec=0.02)


@pytest.fixture
def served_node() -> Iterator[ServedNode]:
    made = ServedNode()
    yield made
    made.executor.shutdown()
    made.node.destroy_node()
    made.context.try_shutdown()


def test_node_with_ordinary_entities_keeps_events_executor(served_node: ServedNode) -> None:
    from std_srvs.srv import Trigger

    served_node.node.create_service(Trigger, "plain", lambda _, response: response)
    served_node.node.create_timer(1.0, lambda: None)
    assert served_node.select_executor() == "EventsExecutor"


def test_guard_condition_selects_executor_with_wait_set(served_node: ServedNode) -> None:
    heard: list[bool] = []
    guard = served_node.node.create_guard_condition(lambda: heard.append(True))
    assert served_node.select_executor() == "SingleThreadedExecutor"
    guard.trigger()
    served_node.spin_until(lambda: heard, "the guard")
    assert served_node.node.executor is served_node.executor


def test_service_with_coroutine_responds(served_node: ServedNode) -> None:
    from std_srvs.srv import Trigger

    async def answer(_: Any, response: Any) -> Any:
        response.message = "later"
        return response

    served_node.node.create_service(Trigger, "slow", answer)
    assert served_node.select_executor() == "SingleThreadedExecutor"
    client = served_node.node.create_client(Trigger, "slow")
    served_node.spin_until(client.service_is_ready, "the service")
    called = client.call_async(Trigger.Request())
    served_node.spin_until(called.done, "the answer")
    assert called.result().message == "later"


def test_executor_with_wait_set_is_kept(served_node: ServedNode) -> None:
    from sar_compiler.ros.executors import make_executor

    served_node.executor.shutdown()
    served_node.executor = wanted = make_executor(served_node.context, "single-threaded")
    served_node.executor.add_node(served_node.node)
    served_node.node.create_guard_condition(lambda: None)
    assert served_node.select_executor() == "SingleThreadedExecutor"
    assert served_node.executor is wanted
