"""Finding the behaviour that raised an exception, and logging it."""

import os
import traceback
from pathlib import Path

import py_trees
import rclpy.logging
from py_trees.behaviour import Behaviour
from rclpy.node import Node

import sar_compiler
from sar_compiler.compiler.origins import place_of
from sar_compiler.errors import SarError
from sar_compiler.tree.showing import in_one_line, visible

_OURS = tuple(str(Path(str(package.__file__)).parent) + os.sep for package in (sar_compiler, py_trees))
_TRACEBACKS = "traceback"
"""The part that the name of the logger of tracebacks has behind the node's."""


def described(error: BaseException) -> str:
    """Return an exception's type and text in one line; the project's own need no type."""
    text = " ".join(str(error).split())
    if isinstance(error, SarError):
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def raised_in(error: BaseException) -> Behaviour | None:
    """Return the innermost behaviour of a tree that an exception passed through, if any."""
    passed = _behaviours_passed(error)
    return passed[-1] if passed else None


def called_by_engine(error: BaseException) -> Behaviour | None:
    """Return the outermost behaviour of a tree that an exception passed through, if any."""
    passed = _behaviours_passed(error)
    return passed[0] if passed else None


def named(behaviour: Behaviour | None) -> str:
    """Name the behaviour that raised an exception, for a message."""
    if behaviour is None:
        return "a tick handler"
    return f"'{behaviour.name}' ({type(behaviour).__name__})"


def places(behaviour: Behaviour | None, error: BaseException) -> str:
    """Return where an exception of a behaviour comes from, in brackets: the lines of the tree file and of Python.

    Empty if neither is known. The line of Python is that in the behaviour's own method; what is called there is in the
    traceback.
    """
    known = [place_of(behaviour) if behaviour is not None else None, _line_of(behaviour, error)]
    said = "; ".join(place for place in known if place is not None)
    return f" ({said})" if said else ""


def failure_text(error: BaseException) -> str:
    """Return who has raised an exception in a tick, what, and where."""
    behaviour = raised_in(error)
    return f"{named(behaviour)} failed: {described(error)}{places(behaviour, error)}"


def _line_of(behaviour: Behaviour | None, error: BaseException) -> str | None:
    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        code = frame.f_code
        is_own = behaviour is None or frame.f_locals.get("self") is behaviour
        if is_own and not code.co_filename.startswith(_OURS):
            path = os.path.relpath(code.co_filename)
            return f"{code.co_filename if path.startswith(os.pardir) else path}:{line}, in {code.co_name}"
    return None


def show_tracebacks(node: Node) -> None:
    """Have the tracebacks of all that fails logged, which otherwise only `--log-level debug` shows."""
    _traceback_logger(node).set_level(rclpy.logging.LoggingSeverity.DEBUG)


def _traceback_logger(node: Node) -> rclpy.logging.RcutilsLogger:
    return rclpy.logging.get_logger(f"{node.get_logger().name}.{_TRACEBACKS}")


def tell(node: Node | None, text: str, error: BaseException | None = None) -> None:
    """Log an error, if there is a node to log it.

    Args:
        node: The node.
        text: What is wrong.
        error: Its cause; the traceback is logged at debug level.
    """
    if node is None:
        return
    node.get_logger().error(in_one_line(text))
    if error is not None:
        _traceback_logger(node).debug(visible("".join(traceback.format_exception(error))))


def tell_failure(node: Node | None, error: BaseException) -> Behaviour | None:
    """Log an exception raised in a tick, because of which the tree is stopped.

    Returns:
        The behaviour that raised it; None if it was not a behaviour of the tree.
    """
    tell(node, f"{failure_text(error)}. The tree is stopped.", error)
    return raised_in(error)


def _behaviours_passed(error: BaseException) -> list[Behaviour]:
    owners = [frame.f_locals.get("self") for frame, _ in traceback.walk_tb(error.__traceback__)]
    # What the kernel raises about a behaviour has passed through none of its methods.
    owners.append(getattr(error, "behaviour", None))
    return [owner for owner in owners if isinstance(owner, Behaviour)]
