"""Which Python modules are installed on this machine, as against those that merely lie where a tree file does.

A checkout is data, and so is the current folder: whoever validates a stranger's trees runs none of his code. But
`sys.path` may lead there all the same, by an empty part of `PYTHONPATH` or by `python -m`, to packages and to what
looks like the metadata of an installed distribution. So those folders are left out here, whatever `sys.path` says.

What stays: the folders of the interpreter (a virtual environment may lie in the checkout), the one that this package
runs from, and the ROS workspaces that were sourced. A distribution there that was installed with `pip install -e`
says so, and names the folder of its modules; to have installed it is to trust that folder.
"""

import importlib
import json
import os
import site
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import Distribution, EntryPoint, distributions
from pathlib import Path
from types import ModuleType
from urllib.parse import urlsplit
from urllib.request import url2pathname

_OWN_FOLDER = Path(__file__).resolve().parents[2]


def entry_points(group: str, checkout: Path | None = None) -> list[EntryPoint]:
    """Return the entry points of a group that installed distributions have.

    Args:
        group: The group.
        checkout: A folder of which nothing counts as installed, besides the current one.
    """
    return list(_entry_points(group, _installed(checkout)).values())


def ignored_entry_points(group: str, checkout: Path | None = None) -> list[tuple[EntryPoint, str]]:
    """Return the entry points that only distributions in the checkout or the current folder have, with the folder."""
    installed = _installed(checkout)
    known = {each.value for each in _entry_points(group, installed).values()}
    others = [entry for entry in sys.path if entry not in installed]
    return [
        (entry_point, entry or os.curdir)
        for entry in others
        for entry_point in _entry_points(group, [entry]).values()
        if entry_point.value not in known
    ]


def is_installed(module: str, checkout: Path | None = None) -> bool:
    """Return whether a module is of an installed package; imports nothing.

    The modules of Python itself do not count: none of them is there to be named by a configuration.
    """
    top, *rest = module.split(".")
    if top in sys.stdlib_module_names or not all(part.isidentifier() for part in (top, *rest)):
        return False
    with _importing(checkout):
        return any(finder.find_spec(top, None) is not None for finder in sys.meta_path)


def import_installed(module: str, checkout: Path | None = None) -> ModuleType:
    """Import a module, and what it imports, from what is installed.

    Raises:
        ImportError: If it is not there.
    """
    with _importing(checkout):
        return importlib.import_module(module)


def _entry_points(group: str, path: Iterable[str]) -> dict[tuple[str, str], EntryPoint]:
    """Return the entry points of a group by distribution and name; of several distributions of a name the first counts."""
    found: dict[tuple[str, str], EntryPoint] = {}
    seen: set[str] = set()
    for distribution in distributions(path=list(path)):
        if group not in (distribution.read_text("entry_points.txt") or ""):
            continue
        name = distribution.metadata["Name"] or ""
        if name not in seen:
            seen.add(name)
            mine = distribution.entry_points.select(group=group)
            found.update({(name, entry_point.name): entry_point for entry_point in mine})
    return found


def _installed(checkout: Path | None) -> list[str]:
    """Return the part of `sys.path` that holds what is installed."""
    strange, trusted = _current_folders(), [*_site_folders(), _OWN_FOLDER]
    sourced = [Path(part).resolve() for part in _parts("AMENT_PREFIX_PATH") if Path(part).is_absolute()]

    def is_installed_in(folder: Path) -> bool:
        if folder in trusted or any(folder.is_relative_to(prefix) for prefix in sourced):
            return True
        return folder not in strange and not (checkout and folder.is_relative_to(checkout.resolve()))

    return [entry for entry in sys.path if entry and is_installed_in(Path(entry).resolve())]


def _current_folders() -> set[Path]:
    """Return the folders that `sys.path` has because of where the process was started."""
    written = (part for part in _parts("PYTHONPATH") if not Path(part).is_absolute())
    with suppress(OSError):  # the current folder may have been deleted
        return {Path.cwd(), *(Path(part).resolve() for part in written)}
    return set()


def _site_folders() -> list[Path]:
    paths = sysconfig.get_paths()
    folders = (paths["purelib"], paths["platlib"], paths["stdlib"], *site.getsitepackages())
    return [Path(folder).resolve() for folder in (*folders, site.getusersitepackages())]


def _parts(variable: str) -> list[str]:
    return os.environ.get(variable, "").split(os.pathsep)


@contextmanager
def _importing(checkout: Path | None) -> Iterator[None]:
    """Let imports see what is installed only, and the folders of what is installed to be edited."""
    installed = _installed(checkout)
    edited = [folder for each in distributions(path=installed) if (folder := _edited(each)) is not None]
    before = sys.path[:]
    sys.path[:] = [
        entry
        for entry in before
        if entry in installed or any(Path(entry).resolve().is_relative_to(folder) for folder in edited)
    ]
    try:
        yield
    finally:
        sys.path[:] = before


def _edited(distribution: Distribution) -> Path | None:
    """Return the folder of a distribution that was installed with `pip install -e`; None for any other."""
    origin = distribution.read_text("direct_url.json")
    if not origin:
        return None
    with suppress(ValueError, KeyError, TypeError, AttributeError):
        said = json.loads(origin)
        if said["dir_info"].get("editable"):
            return Path(url2pathname(urlsplit(said["url"]).path)).resolve()
    return None
