"""Lazy imports: a module exports public names of other modules, and imports each of them only at its first use.

The module lists the names only once, as imports for type checkers. `lazy` reads this list from the module's source.
"""

import importlib
import sys
from collections.abc import Callable
from typing import Any

_LookUp = Callable[[str], object]


def lazy(module: str) -> tuple[_LookUp, Callable[[], list[str]], list[str]]:
    """Return the `__getattr__`, the `__dir__` and the `__all__` of a module with lazy imports.

    Args:
        module: The name of the module. Its source contains a line `from MODULE import X as X` for each public name, which only type
                checkers execute.
    """
    spec: Any = sys.modules[module].__spec__
    lines = (line.split() for line in spec.loader.get_data(spec.origin).decode().splitlines())
    sources = {line[3]: line[1] for line in lines if line[:1] == ["from"] and line[4:5] == ["as"]}

    def look_up(name: str) -> object:
        if name not in sources:
            raise AttributeError(f"module '{module}' has no attribute '{name}'", name=name)
        value = getattr(importlib.import_module(sources[name]), name)
        setattr(sys.modules[module], name, value)
        return value

    return look_up, lambda: [*vars(sys.modules[module]), *sources], [*sources]
