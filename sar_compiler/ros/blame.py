"""Whose exception it was."""

import traceback

from py_trees.behaviour import Behaviour


def described(error: BaseException) -> str:
    """Return an exception's type and text in one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def raised_in(error: BaseException) -> Behaviour | None:
    """Return the innermost behaviour of a tree that an exception passed through, if any."""
    found = None
    for frame, _ in traceback.walk_tb(error.__traceback__):
        owner = frame.f_locals.get("self")
        found = owner if isinstance(owner, Behaviour) else found
    return found


def blamed(behaviour: Behaviour | None) -> str:
    """Name the behaviour that raised an exception, for a message."""
    if behaviour is None:
        return "a tick handler"
    return f"'{behaviour.name}' ({type(behaviour).__name__})"
