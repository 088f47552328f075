"""The kernel: the nodes that tick.

A tree in flat form is a list of nodes over vectors of cells. The cells are all that the tree remembers between two ticks, except for the
blackboard and for what leaves keep to themselves.

mypyc compiles these modules, and those of `sar_compiler.analysis.state_search`, where the package is built with a C compiler. A compiled
module behaves as its source does, and is used only if it was made of the source beside it. `SAR_KERNEL=python` in the environment uses
the sources in any case, `SAR_KERNEL=compiled` refuses to.
"""

import hashlib
import importlib.util
import json
import os
import sys
from collections.abc import Mapping
from importlib.machinery import EXTENSION_SUFFIXES, ModuleSpec
from pathlib import Path
from types import ModuleType

from sar_compiler.runtime.without_librt import stand_in

_PACKAGE = Path(__file__).parents[2]
_FOLDERS = {
    f"{_PACKAGE.name}.{name}": _PACKAGE.joinpath(*name.split("."))
    for name in ("runtime.kernel", "analysis.state_search")
}
"""The packages whose modules are compiled; the second one may be missing."""
_RECORD = _FOLDERS[__name__] / "compiled.json"
"""The digests of the sources of the compiled modules; written by `setup.py`."""


def digests() -> dict[str, str]:
    """Return the digest of each source that is here, by its module."""
    return {
        f"{package}.{path.stem}": hashlib.sha256(path.read_bytes()).hexdigest()
        for package, folder in _FOLDERS.items()
        for path in sorted(folder.glob("*.py"))
        if path.stem != "__init__"
    }


def _state() -> str:
    """Return whether the compiled modules can be used; see `STATE`."""
    if not any((_RECORD.parent / f"cells{suffix}").exists() for suffix in EXTENSION_SUFFIXES):
        return "absent"
    # What they share lies beside the package, and in librt; whoever has only the package cannot import them.
    if not all(importlib.util.find_spec(name) for name in ("sar_compiler_kernel__mypyc", "librt")):
        return "apart"
    try:
        recorded = json.loads(_RECORD.read_bytes())
    except (OSError, ValueError):
        return "stale"
    # An installed package may have been stripped of its sources.
    present = digests()
    is_same = isinstance(recorded, dict) and all(
        recorded.get(name) == digest for name, digest in present.items()
    )
    return "compiled" if is_same else "stale"


STATE = _state()
"""`compiled`, or why not: `stale` (made of other sources), `apart` (from the libraries that they share) or `absent`."""
_WANTED = os.environ.get("SAR_KERNEL", "")
IS_COMPILED = STATE == "compiled" and _WANTED != "python"
"""Whether the compiled modules are in use."""

if _WANTED == "compiled" and not IS_COMPILED:
    message = (
        f"SAR_KERNEL=compiled: the compiled kernel is {STATE}; build the package anew, with a C compiler"
    )
    raise ImportError(message)


class _Sources:
    """Finds the sources, where compiled modules would be found first."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: ModuleType | None = None) -> ModuleSpec | None:  # noqa: ARG004
        """Return where the source of a module is; None for modules of others."""
        package, _, module = name.rpartition(".")
        if package not in _FOLDERS:
            return None
        return importlib.util.spec_from_file_location(name, _FOLDERS[package] / f"{module}.py")


stand_in()
if STATE != "absent" and not IS_COMPILED:
    sys.meta_path.insert(0, _Sources)


def describe() -> str:
    """Return what is in use, for people."""
    words: Mapping[str, str] = {
        "compiled": "Python, although it is compiled (SAR_KERNEL=python)",
        "stale": "Python (the compiled one was made of other sources, and is not used; build the package anew)",
        "apart": "Python (the compiled one lacks its library, and is not used; install the package anew)",
        "absent": "Python",
    }
    return "compiled" if IS_COMPILED else words[STATE]
