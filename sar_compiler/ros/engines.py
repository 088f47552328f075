"""The choice of the engine that ticks a tree."""

from collections.abc import Callable

from py_trees.behaviour import Behaviour

from sar_compiler.ros.engine import Engine, EngineError

EngineFactory = Callable[[Behaviour], Engine]


def find_engine(name: str) -> EngineFactory:
    """Return the factory that creates an engine for the root of a tree.

    Args:
        name: The engine's name, `own` or `py_trees_ros`.

    Raises:
        EngineError: If the engine, or a module that the engine needs, is not installed.
    """
    if name == "own":
        from sar_compiler.ros.runner import TreeRunner

        return TreeRunner
    try:
        from sar_compiler.ros.py_trees_ros_engine import PyTreesRosEngine
    except ImportError as error:
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if (missing or "").partition(".")[0] == "py_trees_ros":
            message = (
                f"--engine py_trees_ros: py_trees_ros is not installed ({error}) and not available on PyPI. On a robot, run sudo apt "
                f"install ros-jazzy-py-trees-ros, or omit --engine to use the built-in engine"
            )
        else:
            reason = f"{missing} is missing" if missing else str(error)
            message = f"--engine py_trees_ros: py_trees_ros cannot be loaded ({reason}). Fix its installation, or omit --engine to use the built-in engine"
        raise EngineError(message) from error
    return PyTreesRosEngine
