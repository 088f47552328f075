"""What a public group of names is made of: each name is looked up where it lives, when it is first used."""

import importlib
import sys
from collections.abc import Callable, Mapping


def lazy(group: str, modules: Mapping[str, tuple[str, ...]]) -> tuple[Callable[[str], object], list[str]]:
    """Return the `__getattr__` of a group, and its names.

    Args:
        group: The name of the module that is the group.
        modules: The names by the module of this package in which they live.
    """
    homes = {name: module for module, names in modules.items() for name in names}

    def look_up(name: str) -> object:
        if name not in homes:
            message = f"module '{group}' has no attribute '{name}'"
            raise AttributeError(message, name=name)
        value = getattr(importlib.import_module(f"sar_compiler.{homes[name]}"), name)
        setattr(sys.modules[group], name, value)
        return value

    return look_up, [*homes]
