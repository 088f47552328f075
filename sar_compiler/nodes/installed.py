"""Discovery of installed Python modules. Modules in the folder of a tree file are not installed.

A check of other people's trees must not run their code. The checkout and the current folder are therefore excluded, even
if `sys.path` contains them (through an empty part of `PYTHONPATH`, or `python -m`). Otherwise, packages in these folders
could be imported, and their files could imitate the metadata of installed distributions.

The folders of the interpreter, the folder of this package, and the sourced ROS workspaces are included. A virtual
environment in the checkout is therefore included as well. So is the folder of a distribution that was installed with
`pip install -e`, because the user trusts the folder by installing the distribution.
"""

import functools
import importlib
import json
import os
import site
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from sar_compiler.opener import METADATA, UnreadableFileError, read_file

_OWN_FOLDER = Path(__file__).resolve().parents[2]
_METADATA = (".dist-info", ".egg-info")
_passed_over: list[str] = []


class EntryPoint(NamedTuple):
    """An entry point of an installed distribution.

    Attributes:
        name: The name of the entry point.
        value: The target: `package.module` or `package.module:attribute`.
    """

    name: str
    value: str

    @property
    def module(self) -> str:
        """The module of the target."""
        return self.value.partition(":")[0].strip()

    @property
    def attr(self) -> str:
        """The attribute of the target; empty if the target is a module."""
        return self.value.partition(":")[2].strip()


def entry_points(group: str, checkout: Path | None = None) -> list[EntryPoint]:
    """Return the entry points of a group from installed distributions.

    Args:
        group: The group.
        checkout: A folder whose content is not regarded as installed, in addition to the current folder.
    """
    return list(_entry_points(group, _installed_folders(checkout)).values())


def ignored_entry_points(group: str, checkout: Path | None = None) -> list[tuple[EntryPoint, str]]:
    """Return the entry points that exist only in the checkout or in the current folder, each with this folder."""
    installed = _installed_folders(checkout)
    found = [
        (entry_point, entry or os.curdir)
        for entry in (*sys.path, *_passed_over)
        if entry not in installed
        for entry_point in _entry_points(group, [entry]).values()
    ]
    known = {each.value for each in _entry_points(group, installed).values()} if found else set()
    return [(entry_point, place) for entry_point, place in found if entry_point.value not in known]


def pass_over(entries: Iterable[str]) -> None:
    """Record the entries that were removed from `sys.path` because they depend on the working directory.

    Entries with installed packages are restored. The remaining entries are searched only for modules that the user names.
    """
    given = [*entries]
    sys.path[:0] = given
    _passed_over.extend(entry for entry in given if entry not in _importable(None))
    sys.path[:] = [entry for entry in sys.path if entry not in _passed_over]


def allow_current_folder() -> None:
    """Allow imports from the current folder, for modules that the user names.

    Installed modules take precedence.
    """
    with suppress(OSError):  # the folder may have been deleted
        for entry in (*_passed_over, str(Path.cwd())):
            if entry not in sys.path:
                sys.path.append(entry)


def has_entry_point(module: str, group: str, checkout: Path | None = None) -> bool:
    """Check, without importing a module, whether its installed package has an entry point of a group.

    A file may request the import only of modules with an entry point. Importing any other module could run any code.

    Args:
        module: The module's import path.
        group: The group.
        checkout: A folder whose content is not regarded as installed, in addition to the current folder.
    """
    top, *rest = module.split(".")
    offered = {each.module for each in entry_points(group, checkout)}
    if not all(part.isidentifier() for part in (top, *rest)) or not _is_parent_package(top, offered):
        return False
    with _restrict_imports(checkout):
        specs = ((finder, finder.find_spec(top, None)) for finder in sys.meta_path)
        finder, spec = next((found for found in specs if found[1] is not None), (None, None))
        subpackage = ".".join((top, *rest[:1]))
        if spec is None or (spec.loader is None and not _is_parent_package(subpackage, offered)):
            # Distributions of different authors may share a namespace package.
            return False
        if checkout is None or finder is not PathFinder:
            return True
        places = map(Path, spec.submodule_search_locations or [spec.origin or ""])
        return not any(_is_checkout_a_package(place, rest, checkout.resolve()) for place in places)


def _is_parent_package(package: str, modules: Iterable[str]) -> bool:
    return any(f"{module}.".startswith(f"{package}.") for module in modules)


def _is_checkout_a_package(top: Path, rest: list[str], checkout: Path) -> bool:
    """Return whether a module is in a checkout that is below a folder of `sys.path`.

    For example, that folder may contain several checkouts. Python then treats each checkout as a package.
    """
    folder = top.parent.resolve()
    return (folder / top.name).joinpath(*rest).is_relative_to(checkout) and not folder.is_relative_to(
        checkout
    )


def import_installed(module: str, checkout: Path | None = None) -> ModuleType:
    """Import a module and its imports from installed packages only.

    Raises:
        ImportError: If the module or one of its imports is not installed.
    """
    with _restrict_imports(checkout):
        return importlib.import_module(module)


def _entry_points(group: str, path: Iterable[str]) -> dict[tuple[str, str], EntryPoint]:
    """Return the entry points of a group by distribution and name.

    If a distribution is found in several folders, the first is used.
    """
    found: dict[tuple[str, str], EntryPoint] = {}
    seen: set[str] = set()
    for name, text in _metadata(path, "entry_points.txt"):
        if group in text and name not in seen:
            seen.add(name)
            found.update({(name, each.name): each for each in _parse_group(text, group)})
    return found


def _metadata(path: Iterable[str], file: str) -> Iterator[tuple[str, str]]:
    """Yield the name and the content of a metadata file for each distribution that has this file."""
    for folder in path:
        with suppress(OSError):
            state = os.stat(folder or os.curdir)  # noqa: PTH116
            yield from _metadata_in(folder or os.curdir, (state.st_ino, state.st_mtime_ns), file)


@functools.cache
def _metadata_in(folder: str, _as_it_is: tuple[int, int], file: str) -> list[tuple[str, str]]:
    """Return the name and the content of a metadata file for each distribution in a folder.

    `importlib.metadata` is not used, because importing it takes longer than checking most trees.
    """
    with os.scandir(folder) as entries:
        names = sorted(entry.name for entry in entries if entry.name.endswith(_METADATA))
    found = []
    for each in names:
        if not os.path.exists(f"{folder}/{each}/{file}"):  # noqa: PTH110 - most do not exist, and this is fast
            continue
        name = each.rpartition(".")[0].partition("-")[0].lower().replace(".", "_")
        with suppress(UnreadableFileError):
            found.append((name, read_file(Path(folder, each, file), METADATA).decode()))
    return found


def _parse_group(text: str, group: str) -> Iterator[EntryPoint]:
    section = ""
    for line in map(str.strip, text.splitlines()):
        if line.startswith("["):
            section = line.strip("[] ")
        elif section == group and "=" in line and not line.startswith("#"):
            name, _, value = line.partition("=")
            yield EntryPoint(name.strip(), value.strip())


def _installed_folders(checkout: Path | None) -> list[str]:
    """Return the folders of `sys.path` that contain installed packages."""
    strange, outside = _current_folders(), checkout.resolve() if checkout else None
    sourced = [Path(part).resolve() for part in _parts("AMENT_PREFIX_PATH") if Path(part).is_absolute()]

    def is_installed_in(folder: Path) -> bool:
        if folder not in strange and not (outside and folder.is_relative_to(outside)):
            return True
        return any(folder.is_relative_to(prefix) for prefix in sourced) or folder in _trusted_folders()

    # An entry that is not absolute depends on the current folder, or marks an editable installation.
    return [entry for entry in sys.path if os.path.isabs(entry) and is_installed_in(_resolve(entry))]  # noqa: PTH117


@functools.cache
def _resolve(folder: str) -> Path:
    """Return a folder's path with links resolved.

    The result is cached, because each part of the path takes a system call.
    """
    return Path(folder).resolve()


def _current_folders() -> set[Path]:
    """Return the folders of `sys.path` that depend on the working directory."""
    written = (part for part in _parts("PYTHONPATH") if not Path(part).is_absolute())
    with suppress(OSError):  # the current folder may have been deleted
        return {Path.cwd(), *(Path(part).resolve() for part in written)}
    return set()


def _trusted_folders() -> Iterator[Path]:
    """Yield the folders that contain the interpreter's packages, and the folder of this package."""
    yield _OWN_FOLDER
    packages = *site.getsitepackages(), site.getusersitepackages()
    yield from map(_resolve, (*packages, os.path.dirname(os.__file__)))  # noqa: PTH120


def _parts(variable: str) -> list[str]:
    return os.environ.get(variable, "").split(os.pathsep)


@contextmanager
def _restrict_imports(checkout: Path | None) -> Iterator[None]:
    """Restrict imports to installed packages."""
    before = sys.path[:]
    sys.path[:] = _importable(checkout)
    try:
        yield
    finally:
        sys.path[:] = before


def _importable(checkout: Path | None) -> list[str]:
    """Return the folders of `sys.path` that contain installed packages, and those of editable installations."""
    installed = _installed_folders(checkout)
    origins = (origin for _, origin in _metadata(installed, "direct_url.json"))
    edited = [folder for origin in origins if (folder := _editable_folder(origin)) is not None]
    return [
        entry
        for entry in sys.path
        if entry in installed
        or (os.path.isabs(entry) and any(Path(entry).resolve().is_relative_to(each) for each in edited))  # noqa: PTH117
    ]


def _editable_folder(origin: str) -> Path | None:
    """Return the folder of a distribution that was installed with `pip install -e`; None for other distributions."""
    from urllib.parse import unquote, urlsplit

    with suppress(ValueError, KeyError, TypeError, AttributeError):
        data = json.loads(origin)
        if data["dir_info"].get("editable"):
            path = unquote(urlsplit(data["url"]).path)
            # On Windows the drive follows a slash.
            return Path(path.lstrip("/") if os.name == "nt" else path).resolve()
    return None
