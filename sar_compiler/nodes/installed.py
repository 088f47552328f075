"""Discovery of the Python modules that are installed, as opposed to those that are merely in a tree file's folder.

A checkout is data, and so is the current folder: to validate foreign trees must not run foreign code. But
`sys.path` may include these folders, through an empty part of `PYTHONPATH` or `python -m`, with packages and with
apparent metadata of installed distributions. They are therefore excluded here, whatever `sys.path` contains.

Included are the folders of the interpreter (a virtual environment may be in the checkout), the folder of this
package, and the sourced ROS workspaces. The metadata of a distribution that was installed with `pip install -e`
names the folder of its modules; to install it is to trust that folder.
"""

import importlib
import json
import os
import site
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib.machinery import PathFinder
from importlib.metadata import Distribution, EntryPoint, distributions
from pathlib import Path
from types import ModuleType
from urllib.parse import urlsplit
from urllib.request import url2pathname

_OWN_FOLDER = Path(__file__).resolve().parents[2]


def entry_points(group: str, checkout: Path | None = None) -> list[EntryPoint]:
    """Return the entry points of a group from installed distributions.

    Args:
        group: The group.
        checkout: A folder whose content does not count as installed, in addition to the current folder.
    """
    return list(_entry_points(group, _installed(checkout)).values())


def ignored_entry_points(group: str, checkout: Path | None = None) -> list[tuple[EntryPoint, str]]:
    """Return the entry points found only in the checkout or the current folder, with that folder."""
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
    """Return whether a module belongs to an installed package, without importing it.

    Modules of the standard library do not count: a configuration has no reason to name them.
    """
    top, *rest = module.split(".")
    if top in sys.stdlib_module_names or not all(part.isidentifier() for part in (top, *rest)):
        return False
    with _importing(checkout):
        specs = ((finder, finder.find_spec(top, None)) for finder in sys.meta_path)
        finder, spec = next((found for found in specs if found[1] is not None), (None, None))
        if spec is None or checkout is None or finder is not PathFinder:
            return spec is not None
        places = map(Path, spec.submodule_search_locations or [spec.origin or ""])
        return not any(_is_entered_from_above(place, rest, checkout.resolve()) for place in places)


def _is_entered_from_above(top: Path, rest: list[str], checkout: Path) -> bool:
    """Return whether the way to a module leads from a folder of `sys.path` above a checkout into it.

    Such a folder, which may be the user's own with all his checkouts, makes each of them a package.
    """
    folder = top.parent.resolve()
    return (folder / top.name).joinpath(*rest).is_relative_to(checkout) and not folder.is_relative_to(
        checkout
    )


def import_installed(module: str, checkout: Path | None = None) -> ModuleType:
    """Import a module and its imports from installed packages only.

    Raises:
        ImportError: If it is not installed.
    """
    with _importing(checkout):
        return importlib.import_module(module)


def _entry_points(group: str, path: Iterable[str]) -> dict[tuple[str, str], EntryPoint]:
    """Return the entry points of a group by distribution and name; of equally named distributions the first counts."""
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
    """Return the folders of `sys.path` with installed packages."""
    strange, trusted = _current_folders(), [*_site_folders(), _OWN_FOLDER]
    sourced = [Path(part).resolve() for part in _parts("AMENT_PREFIX_PATH") if Path(part).is_absolute()]

    def is_installed_in(folder: Path) -> bool:
        if folder in trusted or any(folder.is_relative_to(prefix) for prefix in sourced):
            return True
        return folder not in strange and not (checkout and folder.is_relative_to(checkout.resolve()))

    return [entry for entry in sys.path if entry and is_installed_in(Path(entry).resolve())]


def _current_folders() -> set[Path]:
    """Return the folders that are on `sys.path` because of the working directory."""
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
    """Restrict imports to installed packages, including the folders of editable installations."""
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
