"""Which engines there are to tick a tree."""

from collections.abc import Callable

from py_trees.behaviour import Behaviour

from sar_compiler.ros.engine import Engine, EngineError

EngineFactory = Callable[[Behaviour], Engine]


def find_engine(name: str) -> EngineFactory:
    """Return the factory that makes an engine for a tree.

    Args:
        name: `own`, or `py_trees_ros`.

    Raises:
        EngineError: If it, or a module that it needs, is not installed.
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
                "ros-jazzy-py-trees-ros (it is not on PyPI); or leave --engine out, to tick with the project's own"
            )
        else:
            message = (
                f"--engine py_trees_ros: it is here, and cannot be loaded: {f'{missing} is missing' if missing else error}. "
                "Mend that, or leave --engine out, to tick with the project's own"
            )
        raise EngineError(message) from error
    return PyTreesRosEngine
