"""The kernel, which ticks trees.

A tree in flat form is a list of nodes whose state is in vectors of cells. Between two ticks, the cells are the whole
state of the tree, except for the blackboard and the private state of leaves.

mypyc compiles the modules of this package and of `sar_compiler.analysis.state_search` if a C compiler is available. A compiled module
behaves like its Python source, and is used only if it was compiled from the source in the same folder. The environment variable
`SAR_KERNEL=python` selects the Python sources. `SAR_KERNEL=compiled` makes the import fail if the compiled modules cannot be used.
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

from sar_compiler.runtime.without_librt import register_replacements

_PACKAGE = Path(__file__).parents[2]
_FOLDERS = {
    f"{_PACKAGE.name}.{name}": _PACKAGE.joinpath(*name.split("."))
    for name in ("runtime.kernel", "analysis.state_search")
}
"""The packages whose modules are compiled, and the folder of each. The folder of `state_search` can be missing."""
_RECORD = _FOLDERS[__name__] / "compiled.json"
"""The file in which `setup.py` stores the digests of the compiled modules' sources."""


def digests() -> dict[str, str]:
    """Return the digests of the existing sources, by module."""
    return {
        f"{package}.{path.stem}": hashlib.sha256(path.read_bytes()).hexdigest()
        for package, folder in _FOLDERS.items()
        for path in sorted(folder.glob("*.py"))
        if path.stem != "__init__"
    }


def _state() -> str:
    """Return the state of the compiled modules; see `STATE`."""
    if not any((_RECORD.parent / f"cells{suffix}").exists() for suffix in EXTENSION_SUFFIXES):
        return "absent"
    # The compiled modules need a shared library beside the package, and librt. A copy of the package alone lacks both.
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
"""The state of the compiled modules: `compiled` (usable), `stale` (the sources have changed), `apart` (a library is missing) or `absent`
(no module is compiled)."""
_WANTED = os.environ.get("SAR_KERNEL", "")
IS_COMPILED = STATE == "compiled" and _WANTED != "python"
"""Whether this process uses the compiled modules."""

if _WANTED == "compiled" and not IS_COMPILED:
    message = f"SAR_KERNEL=compiled: the compiled kernel is {STATE}. Rebuild the package with a C compiler"
    raise ImportError(message)


class _Sources:
    """An import finder for the Python sources of the kernel. By default, Python would prefer the compiled modules."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: ModuleType | None = None) -> ModuleSpec | None:  # noqa: ARG004
        """Return the import spec of a source module of the kernel, or None for a module of another package."""
        package, _, module = name.rpartition(".")
        if package not in _FOLDERS:
            return None
        return importlib.util.spec_from_file_location(name, _FOLDERS[package] / f"{module}.py")


register_replacements()
if STATE != "absent" and not IS_COMPILED:
    sys.meta_path.insert(0, _Sources)


def describe() -> str:
    """Return a description of the kernel that is in use."""
    descriptions: Mapping[str, str] = {
        "compiled": "Python, although there is a compiled kernel (SAR_KERNEL=python)",
        "stale": "Python, because the sources of the compiled kernel have changed (rebuild the package)",
        "apart": "Python, because the library of the compiled kernel is missing (reinstall the package)",
        "absent": "Python",
    }
    return "compiled" if IS_COMPILED else descriptions[STATE]
