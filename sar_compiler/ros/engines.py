"""The engines that can tick a tree."""

from collections.abc import Callable

from py_trees.behaviour import Behaviour

from sar_compiler.ros.engine import Engine, EngineError

EngineFactory = Callable[[Behaviour], Engine]


def find_engine(name: str) -> EngineFactory:
    """Return the factory that makes an engine for a tree.

    Args:
        name: `own`, or `py_trees_ros`.

    Raises:
        EngineError: If the engine, or a module that it needs, is not installed.
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
                f"--engine py_trees_ros: it is not installed here ({error}). On a robot: sudo apt install "
                "ros-jazzy-py-trees-ros (it is not on PyPI). Or omit --engine to use the built-in engine"
            )
        else:
            message = f"--engine py_trees_ros: it is installed but cannot be loaded: {f'{missing} is missing' if missing else error}. Fix that, or omit --engine to use the built-in engine"
        raise EngineError(message) from error
    return PyTreesRosEngine
