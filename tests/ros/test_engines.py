"""Tests of the py_trees_ros engine on a stand-in with the published interface: py_trees_ros is not on PyPI."""

from __future__ import annotations

import importlib.util
import inspect
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import py_trees
import pytest
from py_trees.common import Status

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tests.ros.conftest import Ros, Said

pytestmark = pytest.mark.ros

STAND_INS = Path(__file__).parents[1] / "stand_ins"
INSTALLED = importlib.util.find_spec("py_trees_ros") is not None


class Probe(py_trees.behaviour.Behaviour):
    """Runs until it is stopped, unless `on_update` returns another status."""

    def __init__(self, on_update: Callable[[], Status] = lambda: Status.RUNNING) -> None:
        super().__init__("Probe")
        self.on_update = on_update
        self.given: dict[str, Any] = {}
        self.ends: list[Status] = []
        self.shutdowns = 0

    def setup(self, **kwargs: Any) -> None:
        self.given = kwargs

    def update(self) -> Status:
        return self.on_update()

    def terminate(self, new_status: Status) -> None:
        self.ends.append(new_status)

    def shutdown(self) -> None:
        self.shutdowns += 1


@pytest.fixture
def engine_class(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The engine on the stand-in class."""
    monkeypatch.syspath_prepend(str(STAND_INS))
    modules = ("py_trees_ros", "py_trees_ros.trees", "sar_compiler.ros.py_trees_ros_engine")
    for name in modules:
        monkeypatch.delitem(sys.modules, name, raising=False)
    from sar_compiler.ros.engines import find_engine

    yield find_engine("py_trees_ros")
    for name in modules:
        sys.modules.pop(name, None)


@pytest.fixture
def engine_of(engine_class: Any, ros: Ros) -> Callable[..., Any]:
    def make(root: py_trees.behaviour.Behaviour, **node_options: Any) -> Any:
        engine = engine_class(root)
        engine.setup(node=ros.node("mission", **node_options))
        return engine

    return make


@pytest.mark.skipif(INSTALLED, reason="py_trees_ros is installed here")
def test_missing_py_trees_ros_is_reported_with_package() -> None:
    from sar_compiler.ros.engine import EngineError
    from sar_compiler.ros.engines import find_engine

    with pytest.raises(EngineError, match=r"No module named 'py_trees_ros'.*ros-jazzy-py-trees-ros"):
        find_engine("py_trees_ros")


@pytest.mark.skipif(not INSTALLED, reason="py_trees_ros is not installed here")
def test_installed_class_has_interface_of_stand_in(engine_class: Any) -> None:
    assumed = engine_class.__mro__[1]
    for name in ("py_trees_ros", "py_trees_ros.trees"):
        sys.modules.pop(name)
    sys.path.remove(str(STAND_INS))
    from py_trees_ros.trees import BehaviourTree

    for method in ("__init__", "setup", "tick_tock", "shutdown"):
        real, ours = (inspect.signature(getattr(it, method)).parameters for it in (BehaviourTree, assumed))
        assert list(real) == list(ours)


def test_node_timer_ticks_tree(engine_of: Callable[..., Any], ros: Ros) -> None:
    engine = engine_of(Probe())
    engine.tick_tock(10.0)
    ros.spin_until(lambda: engine.count >= 3, "three ticks")
    engine.shutdown()


def test_leaves_receive_node(engine_of: Callable[..., Any]) -> None:
    probe = Probe()
    engine = engine_of(probe)
    assert probe.given == {"node": engine.node}
    engine.shutdown()


def test_parameter_overrides_take_effect(engine_of: Callable[..., Any]) -> None:
    from rclpy.parameter import Parameter

    engine = engine_of(
        Probe(),
        automatically_declare_parameters_from_overrides=True,
        parameter_overrides=[Parameter("default_snapshot_stream", value=True)],
    )
    assert engine.node.get_parameter("default_snapshot_stream").value is True
    engine.shutdown()


def test_leaf_exception_stops_tree_and_is_stored(engine_of: Callable[..., Any], ros: Ros) -> None:
    def fail() -> Status:
        message = "the arm fell off"
        raise ValueError(message)

    steady, faulty = Probe(), Probe(fail)
    root = py_trees.composites.Parallel(
        "Both", py_trees.common.ParallelPolicy.SuccessOnAll(), children=[steady, faulty]
    )
    engine = engine_of(root)
    engine.tick_tock(10.0)
    ros.spin_until(lambda: engine.failure, "the failure")
    assert (str(engine.failure), steady.ends) == ("the arm fell off", [Status.INVALID])
    engine.shutdown()


def test_update_without_status_stops_tree(engine_of: Callable[..., Any], ros: Ros, said: Said) -> None:
    probe = Probe(lambda: None)  # type: ignore[arg-type, return-value]
    engine = engine_of(probe)
    engine.tick_tock(10.0)
    ros.spin_until(lambda: engine.failure, "the failure")
    assert probe.ends == [Status.INVALID]
    assert said.has("'Probe' (Probe) failed: update() returned None, which is not a status")
    engine.shutdown()


def test_failing_setup_is_named_and_earlier_leaves_are_shut_down_once(engine_class: Any, ros: Ros) -> None:
    from sar_compiler.ros.engine import SetupFailedError

    class Unready(Probe):
        def setup(self, **kwargs: Any) -> None:
            message = "boom"
            raise ValueError(message)

    ready, unready, untouched = Probe(), Unready(), Probe()
    root = py_trees.composites.Sequence("Sequence", memory=True, children=[ready, unready, untouched])
    engine = engine_class(root)
    with pytest.raises(
        SetupFailedError, match=r"^'Probe' \(Unready\) failed in setup: ValueError: boom \(.*, in setup\)$"
    ):
        engine.setup(node=ros.node())
    engine.shutdown()
    assert (ready.ends, ready.shutdowns) == ([Status.INVALID], 1)
    assert (untouched.shutdowns, unready.shutdowns) == (0, 0)


def test_failing_shutdown_does_not_prevent_shutdown_of_other_leaves(
    engine_of: Callable[..., Any], said: Said
) -> None:
    class Stubborn(Probe):
        def shutdown(self) -> None:
            message = "the arm fell off"
            raise ValueError(message)

    last = Probe()
    engine = engine_of(py_trees.composites.Sequence("Sequence", memory=True, children=[Stubborn(), last]))
    engine.shutdown()
    assert last.shutdowns == 1
    assert said.has("'Probe' could not be shut down: ValueError: the arm fell off")


def test_settle_stops_tree_from_root(engine_of: Callable[..., Any], ros: Ros) -> None:
    probe = Probe()
    engine = engine_of(probe)
    engine.tick_tock(10.0)
    ros.spin_until(lambda: engine.count, "a tick")
    assert engine.settle(ros.executor) == []
    assert probe.ends == [Status.INVALID]
    ticks = engine.count
    ros.spin_for(0.05)
    assert engine.count == ticks
    engine.shutdown()


def test_too_deep_tree_is_rejected_in_setup(engine_class: Any, ros: Ros) -> None:
    from sar_compiler.ros.engine import TreeTooDeepError

    root: py_trees.behaviour.Behaviour = Probe()
    for _ in range(2000):
        root = py_trees.decorators.Inverter("Not", root)
    with pytest.raises(TreeTooDeepError):
        engine_class(root).setup(node=ros.node())
