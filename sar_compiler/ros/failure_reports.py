"""Finding the behaviour that raised an exception, and logging it."""

import traceback

from py_trees.behaviour import Behaviour
from rclpy.node import Node

from sar_compiler.errors import SarError


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


def tell(node: Node | None, text: str, error: BaseException | None = None) -> None:
    """Log an error, if there is a node to log it.

    Args:
        node: The node.
        text: What is wrong.
        error: Its cause; the traceback is logged at debug level.
    """
    if node is None:
        return
    node.get_logger().error(text)
    if error is not None:
        node.get_logger().debug("".join(traceback.format_exception(error)))


def tell_failure(node: Node | None, error: BaseException) -> Behaviour | None:
    """Log an exception raised in a tick, because of which the tree is stopped.

    Returns:
        The behaviour that raised it; None if it was not a behaviour of the tree.
    """
    behaviour = raised_in(error)
    tell(node, f"{named(behaviour)} failed: {described(error)}. The tree is stopped.", error)
    return behaviour


def _behaviours_passed(error: BaseException) -> list[Behaviour]:
    owners = [frame.f_locals.get("self") for frame, _ in traceback.walk_tb(error.__traceback__)]
    # What the kernel raises about a behaviour has passed through none of its methods.
    owners.append(getattr(error, "behaviour", None))
    return [owner for owner in owners if isinstance(owner, Behaviour)]
