"""The files that ship with the package (trees, configuration, maps, worlds), and the folders for the user's state and cache."""

import os
from collections.abc import Mapping
from pathlib import Path

from sar_compiler.errors import SarError
from sar_compiler.opener import (
    STANDARD_INPUT,
    TREE,
    MissingFileError,
    UnreadableFileError,
    is_file,
    is_folder,
    is_there,
    read_file,
)

_PACKAGE = Path(__file__).resolve().parent
# The file that identifies the folder of shipped files, in a checkout and in an installation.
_MANIFEST = "package.xml"


class ResourceError(SarError):
    """A shipped file does not exist."""


def state_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for the user's state. A relative `XDG_STATE_HOME` is ignored, as the XDG specification requires."""
    state = Path(environment.get("XDG_STATE_HOME", ""))
    return (state if state.is_absolute() else Path.home() / ".local" / "state") / "sar_compiler"


def cache_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for the user's cache. The cache can be deleted at any time."""
    cache = Path(environment.get("XDG_CACHE_HOME", ""))
    return (cache if cache.is_absolute() else Path.home() / ".cache") / "sar_compiler"


def shipped_root(package: Path = _PACKAGE) -> Path:
    """Return the folder that contains the shipped `trees/`, `config/`, `maps/`, `worlds/` and so on.

    In a checkout (or an editable installation, or `colcon build --symlink-install`), this is the parent folder of the package. For an
    installed package, it is the nearest `share/sar_compiler` in a folder above the package, such as the virtual environment, `~/.local`,
    `/usr/local`, or the install folder of a workspace.

    Args:
        package: The folder of the package's modules.

    Raises:
        ResourceError: If no such folder exists.
    """
    folders = [package.parent, *(above / "share" / "sar_compiler" for above in package.parents)]
    found = next((folder for folder in folders if (folder / _MANIFEST).is_file()), None)
    if found is None:
        raise ResourceError(
            f"the files of sar_compiler are missing, because no folder above the package in {package} "
            "contains share/sar_compiler. Reinstall sar_compiler with pip or colcon"
        )
    return found


def shared_file_path(kind: str, name: str) -> Path:
    """Return the path of a shipped file.

    Raises:
        ResourceError: If the file does not exist. The message lists the existing files.
    """
    folder = shipped_root() / kind
    path = folder / name
    if path.is_file():
        return path
    existing = ", ".join(sorted(entry.name for entry in folder.glob("*") if entry.is_file())) or "none"
    raise ResourceError(f"{folder} has no shipped file '{name}' (existing files: {existing})")


def find(kind: str, name: str, suffix: str) -> Path:
    """Return the path of a file, given its path or the name of a shipped file.

    Args:
        kind: The folder of the shipped files.
        name: A path, or a shipped file's name without its suffix.
        suffix: The suffix of shipped files, such as `.xml`.

    Returns:
        The path of the shipped file if *name* is its name and no file has the path *name*; otherwise the given path, even if
            it does not exist.
    """
    path = Path(name)
    if not is_shipped_name(name) or is_file(path):
        return path
    named = shipped_root() / kind / f"{name}{suffix}"
    return named if is_file(named) else path


def is_shipped_name(name: str) -> bool:
    """Return whether a name may be that of a shipped file: it has neither a folder nor a suffix."""
    path = Path(name)
    return path.name == name and not path.suffix


def not_found_message(kind: str, name: str, suffix: str) -> str:
    """Return the message for a name for which `find` found no file."""
    from sar_compiler.tree.guessing import did_you_mean, nearest

    noun = kind.removesuffix("s")
    names = sorted(entry.stem for entry in (shipped_root() / kind).glob(f"*{suffix}"))
    files = [f"{name}{each}" for each in (suffix, ".yaml", ".yml") if is_file(f"{name}{each}")]
    hint = did_you_mean(files[0] if files else nearest(name, names))
    return f"there is no {noun} file '{name}', nor a shipped {noun} of that name (shipped: {', '.join(names) or 'none'}){hint}"


def require_tree_file(name: str | Path, *, or_folder: bool = False) -> None:
    """Check that a tree file exists, before the slow imports of the modules that read it.

    Raises:
        UnreadableFileError: If *name* is a folder and *or_folder* is False, or if *name* is clearly a path that does not exist.
    """
    path = find("trees", str(name), ".xml")
    if name and not or_folder and is_folder(path):
        message = (
            f"{name} is a folder: name a tree file in it, or check all its trees with sar-compile validate"
        )
        raise UnreadableFileError(path, "it is a folder", message)
    if name and path != STANDARD_INPUT and not is_shipped_name(str(name)) and not is_there(path):
        try:
            read_file(path, TREE)
        except MissingFileError as error:
            if path.name != str(name) or not is_there(find("trees", path.stem, ".xml")):
                raise
            raise MissingFileError(
                path, error.reason, f"{error}; did you mean the shipped tree {path.stem}?"
            ) from None
