"""Which executor runs a mission's callbacks, and what takes its place where it cannot."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.waiting import SILENCE_SEC

pytestmark = pytest.mark.ros


class Served:
    """A node with an executor of events."""

    def __init__(self) -> None:
        from rclpy.context import Context
        from rclpy.node import Node

        from sar_compiler.ros.executors import make_executor

        pytest.importorskip("rclpy.experimental", reason="an rclpy without EventsExecutor")
        self.context = Context()
        self.context.init(initialize_logging=False)
        self.node = Node("served", context=self.context)
        self.executor: Any = make_executor(self.context, "events")
        self.executor.add_node(self.node)

    def suit(self) -> str:
        """Have what suits the node take the executor's place; return its class."""
        from sar_compiler.ros.executors import suitable_executor

        self.executor = suitable_executor(self.executor, self.node)
        return type(self.executor).__name__

    def spin_until(self, condition: Callable[[], object], what: str) -> None:
        deadline = time.monotonic() + SILENCE_SEC
        while not condition():
            assert time.monotonic() < deadline, f"did not come: {what}"
            self.executor.spin_once(timeout_sec=0.02)


@pytest.fixture
def served() -> Iterator[Served]:
    made = Served()
    yield made
    made.executor.shutdown()
    made.node.destroy_node()
    made.context.try_shutdown()


def test_a_node_with_what_any_node_has_keeps_its_executor_of_events(served: Served) -> None:
    from std_srvs.srv import Trigger

    served.node.create_service(Trigger, "plain", lambda _, response: response)
    served.node.create_timer(1.0, lambda: None)
    assert served.suit() == "EventsExecutor"


def test_a_guard_condition_is_heeded_by_an_executor_with_a_wait_set(served: Served) -> None:
    heard: list[bool] = []
    guard = served.node.create_guard_condition(lambda: heard.append(True))
    assert served.suit() == "SingleThreadedExecutor"
    guard.trigger()
    served.spin_until(lambda: heard, "the guard")
    assert served.node.executor is served.executor


def test_a_service_with_a_coroutine_answers(served: Served) -> None:
    from std_srvs.srv import Trigger

    async def answer(_: Any, response: Any) -> Any:
        response.message = "later"
        return response

    served.node.create_service(Trigger, "slow", answer)
    assert served.suit() == "SingleThreadedExecutor"
    client = served.node.create_client(Trigger, "slow")
    served.spin_until(client.service_is_ready, "the service")
    called = client.call_async(Trigger.Request())
    served.spin_until(called.done, "the answer")
    assert called.result().message == "later"


def test_an_executor_with_a_wait_set_stays_whatever_there_is(served: Served) -> None:
    from sar_compiler.ros.executors import make_executor

    served.executor.shutdown()
    served.executor = wanted = make_executor(served.context, "single-threaded")
    served.executor.add_node(served.node)
    served.node.create_guard_condition(lambda: None)
    assert served.suit() == "SingleThreadedExecutor"
    assert served.executor is wanted
