"""The kernel: the nodes that tick.

A tree in flat form is a list of nodes over vectors of cells. Between two ticks, the cells are the whole state of the tree, except for
the blackboard and the private state of leaves.

mypyc compiles these modules and those of `sar_compiler.analysis.state_search` if a C compiler is available. A compiled module
behaves like its source, and is used only if it was compiled from the source beside it. `SAR_KERNEL=python` in the environment
forces the sources, and `SAR_KERNEL=compiled` rejects them.
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
    """Return the digest of each existing source, by its module."""
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
    # Their shared library is beside the package, and librt is separate; a copy of the package alone lacks both.
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
"""`compiled`, or the reason why not: `stale` (other sources), `apart` (shared libraries missing) or `absent`."""
_WANTED = os.environ.get("SAR_KERNEL", "")
IS_COMPILED = STATE == "compiled" and _WANTED != "python"
"""Whether the compiled modules are in use."""

if _WANTED == "compiled" and not IS_COMPILED:
    message = f"SAR_KERNEL=compiled: the compiled kernel is {STATE}: rebuild the package with a C compiler"
    raise ImportError(message)


class _Sources:
    """Finds the sources, although the import system would prefer compiled modules."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: ModuleType | None = None) -> ModuleSpec | None:  # noqa: ARG004
        """Return the location of a module's source; None for other modules."""
        package, _, module = name.rpartition(".")
        if package not in _FOLDERS:
            return None
        return importlib.util.spec_from_file_location(name, _FOLDERS[package] / f"{module}.py")


stand_in()
if STATE != "absent" and not IS_COMPILED:
    sys.meta_path.insert(0, _Sources)


def describe() -> str:
    """Return a description of the kernel in use."""
    words: Mapping[str, str] = {
        "compiled": "Python, although a compiled one exists (SAR_KERNEL=python)",
        "stale": "Python (the compiled one is not used, because its sources have changed: rebuild the package)",
        "apart": "Python (the compiled one is not used, because its library is missing: reinstall the package)",
        "absent": "Python",
    }
    return "compiled" if IS_COMPILED else words[STATE]
