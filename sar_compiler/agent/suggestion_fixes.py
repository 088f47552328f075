"""Applies the suggestions that findings contain to the text of a tree file."""

from collections.abc import Callable
from pathlib import Path

from sar_compiler.checks.fixing import apply_fixes, fixes
from sar_compiler.project import ProjectTree
from sar_compiler.tree.content import real_path
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.discovery import parse_tree, read_tree_file
from sar_compiler.tree.forest import Read
from sar_compiler.tree.model import TreeFile

_ROUNDS = 20
"""The maximum number of passes over the file. A further pass is needed if a fix reveals another error."""


def apply_suggestions(
    path: Path,
    load: Callable[[Read], ProjectTree],
    is_meant: Callable[[Diagnostic], bool] = lambda _finding: True,
) -> ProjectTree:
    """Apply the suggestions of the findings to the text of a tree file, and return the resulting tree.

    Args:
        path: The file, which is not changed.
        load: Function that loads the file with a given function that reads files.
        is_meant: Decides whether to apply a suggestion; by default all suggestions are applied, even uncertain ones.

    Raises:
        UnreadableFileError: If the file, or a palette, does not exist or cannot be read.
        TreeError: If the project's configuration, or a palette, has errors.
    """
    own, texts = real_path(path), list[str]()

    def read(place: Path) -> TreeFile:
        return (
            parse_tree(texts[-1], str(place)) if texts and real_path(place) == own else read_tree_file(place)
        )

    tree = load(read)
    for _ in range(_ROUNDS):
        chosen = fixes(tree.source, tree.tree_file, tree.findings, is_meant)
        if not chosen:
            break
        texts.append(apply_fixes(tree.source.text, chosen))
        tree = load(read)
    return tree
