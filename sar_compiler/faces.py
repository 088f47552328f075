"""What a public group of names is made of: each name is looked up where it lives, when it is first used.

A group says its names twice: `import X as X` for type checkers, and the modules in which they live for the look-up.
"""

import importlib
import sys
from collections.abc import Callable, Mapping

_LookUp = Callable[[str], object]


def lazy(
    group: str, modules: Mapping[str, tuple[str, ...]]
) -> tuple[_LookUp, Callable[[], list[str]], list[str]]:
    """Return the `__getattr__`, the `__dir__` and the `__all__` of a group.

    Args:
        group: The name of the module that is the group.
        modules: The names by the module of this package in which they live.
    """
    homes = {name: module for module, names in modules.items() for name in names}

    def look_up(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module '{group}' has no attribute '{name}'", name=name)
        value = getattr(importlib.import_module(f"sar_compiler.{homes[name]}"), name)
        setattr(sys.modules[group], name, value)
        return value

    return look_up, lambda: [*vars(sys.modules[group]), *homes], [*homes]
