"""Classes and functions by their import paths: `module:name`."""

import functools
import importlib
from typing import Any


def path_of(thing: Any) -> str:
    """Return the import path of a class or function."""
    return f"{thing.__module__}:{thing.__qualname__}"


def load(path: str) -> Any:
    """Import a class or function.

    Raises:
        ImportError: If there is no such module.
        AttributeError: If nothing in it has the name.
    """
    module, _, name = path.partition(":")
    return functools.reduce(getattr, name.split("."), importlib.import_module(module))
