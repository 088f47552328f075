"""Look-up of a tree file by path or name."""

from pathlib import Path

from sar_compiler import resources
from sar_compiler.tree.diagnostic import UnreadableFileError


def path_named(name: str) -> Path:
    """Return the path that a user names.

    Raises:
        UnreadableFileError: If *name* is empty, which would mean the current folder.
    """
    if not name:
        message = "the name of a tree file is empty"
        raise UnreadableFileError(message)
    return Path(name)


def find_tree(name: str) -> Path:
    """Return the tree file that a user means.

    Args:
        name: The path of a tree file, or the name of a shipped tree (`search_and_rescue`).

    Returns:
        The file; where *name* is plainly a path, it may not be there.

    Raises:
        UnreadableFileError: If *name* is empty, or a bare word, and neither a file nor a shipped tree is called so.
    """
    path = resources.find("trees", str(path_named(name)), ".xml")
    if resources.is_bare_word(name) and not path.exists():
        raise UnreadableFileError(resources.not_found("trees", name, ".xml"))
    return path
