"""Fixtures with ROS contexts, nodes, and executors that spin until a condition holds."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.waiting import SILENCE_SEC

# More callbacks than are ready at once in any test.
_READY = 20


class Ros:
    """One context with one executor, and the nodes in it."""

    def __init__(self, args: list[str] | None = None) -> None:
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor

        self.context = Context()
        self.context.init(args=args, initialize_logging=False)
        self.executor = SingleThreadedExecutor(context=self.context)

    def node(self, name: str = "tester", **options: Any) -> Any:
        from rclpy.node import Node

        return self.add(Node(name, context=self.context, **options))

    def add(self, node: Any) -> Any:
        self.executor.add_node(node)
        return node

    def remove(self, node: Any) -> None:
        self.executor.remove_node(node)
        node.destroy_node()

    def spin_until(
        self, condition: Callable[[], object], what: str, timeout_sec: float = SILENCE_SEC
    ) -> None:
        deadline = time.monotonic() + timeout_sec
        while not condition():
            assert time.monotonic() < deadline, f"did not come within {timeout_sec:g} s: {what}"
            self.executor.spin_once(timeout_sec=0.02)

    def spin_for(self, duration_sec: float) -> None:
        """Spin for a time in which something must not happen, then run every callback that is ready, even if this process is late."""
        deadline = time.monotonic() + duration_sec
        while (left := deadline - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=left)
        for _ in range(_READY):
            self.executor.spin_once(timeout_sec=0.0)

    def close(self) -> None:
        nodes = self.executor.get_nodes()
        self.executor.shutdown()
        for node in nodes:
            node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def make_ros() -> Iterator[Callable[..., Ros]]:
    """Return a function that makes further contexts, such as one with arguments."""
    stages: list[Ros] = []

    def make(args: list[str] | None = None) -> Ros:
        stages.append(Ros(args))
        return stages[-1]

    yield make
    for stage in stages:
        stage.close()


@pytest.fixture
def ros(make_ros: Callable[..., Ros]) -> Ros:
    return make_ros()


class Said:
    """The lines that were logged, from stdout and stderr."""

    def __init__(self, capfd: pytest.CaptureFixture[str]) -> None:
        self._capfd = capfd
        self._lines: list[str] = []

    def lines(self) -> list[str]:
        out, err = self._capfd.readouterr()
        self._lines += (out + err).splitlines()
        return self._lines

    def has(self, *parts: str) -> bool:
        return any(all(part in line for part in parts) for line in self.lines())


@pytest.fixture
def said(capfd: pytest.CaptureFixture[str]) -> Said:
    return Said(capfd)
