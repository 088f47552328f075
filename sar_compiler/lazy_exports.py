"""Public groups of names: each name is imported from its module at its first use.

A group lists its names once, as imports for type checkers; this module reads them there.
"""

import importlib
import sys
from collections.abc import Callable
from typing import Any

_LookUp = Callable[[str], object]


def lazy(group: str) -> tuple[_LookUp, Callable[[], list[str]], list[str]]:
    """Return the `__getattr__`, the `__dir__` and the `__all__` of a group.

    Args:
        group: The name of the module that is the group. In its source, each public name is a line `from MODULE import X as X`, which only
                type checkers execute.
    """
    spec: Any = sys.modules[group].__spec__
    lines = (line.split() for line in spec.loader.get_data(spec.origin).decode().splitlines())
    homes = {line[3]: line[1] for line in lines if line[:1] == ["from"] and line[4:5] == ["as"]}

    def look_up(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module '{group}' has no attribute '{name}'", name=name)
        value = getattr(importlib.import_module(homes[name]), name)
        setattr(sys.modules[group], name, value)
        return value

    return look_up, lambda: [*vars(sys.modules[group]), *homes], [*homes]
