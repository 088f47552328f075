"""Where the files are that ship with the package: trees, configuration, maps, worlds."""

import sysconfig
from pathlib import Path

from sar_compiler.errors import SarError

_CHECKOUT = Path(__file__).resolve().parent.parent
_INSTALLED = Path(sysconfig.get_path("data")) / "share" / "sar_compiler"


class ResourceError(SarError):
    """A shipped file was asked for that does not exist."""


def shipped_root() -> Path:
    """Return the folder that holds the shipped `trees/`, `config/`, `maps/` and `worlds/`.

    In a checkout (also an editable install) that is the folder around the package; after an ordinary
    installation it is `share/sar_compiler` below the environment.
    """
    return _CHECKOUT if (_CHECKOUT / "trees").is_dir() else _INSTALLED


def shipped(kind: str, name: str) -> Path:
    """Return the path of a shipped file.

    Args:
        kind: The folder: `trees`, `config`, `maps` or `worlds`.
        name: The file's name in it.

    Raises:
        ResourceError: If there is no such file; the message lists those there are.
    """
    folder = shipped_root() / kind
    path = folder / name
    if path.is_file():
        return path
    present = ", ".join(sorted(entry.name for entry in folder.glob("*") if entry.is_file())) or "nothing"
    message = f"no file '{name}' is shipped in {folder} (there is: {present})"
    raise ResourceError(message)


def find(kind: str, name: str, suffix: str) -> Path:
    """Return the file that a user means by a path or by the name of a shipped file.

    Args:
        kind: The folder of the shipped files.
        name: A path, or a shipped file's name without its suffix.
        suffix: What shipped names end with, for instance `.xml`.

    Returns:
        The shipped file where *name* is a bare word and one is shipped under it; otherwise the path
        as written, whether there is such a file or not.
    """
    path = Path(name)
    named = shipped_root() / kind / f"{name}{suffix}"
    if path.name == name and not path.suffix and not path.exists() and named.is_file():
        return named
    return path
