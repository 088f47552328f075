"""Paths of files as a report tells them: where the folders of a robot lie says nothing elsewhere."""

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from sar_compiler.journal.journal_entries import OF_ROBOT, RUN_BEGAN, JournalEntry
from sar_compiler.journal.mission_state import tree_nodes

# What has no paths, and much else.
_WITHOUT = {*OF_ROBOT} - {"log"}


class ShortPaths:
    """Shortens the paths in the entries of a journal.

    A path is told from the folder that the files of the tree share, from the journal's or from the current one, whichever is
    the nearest above it; else from the user's, `~`.

    Args:
        folder: The journal's folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folders = {str(folder.absolute()), str(Path.cwd())}
        self._find = self._pattern()

    def of(self, stream: Iterable[JournalEntry]) -> Iterator[JournalEntry]:
        """Yield entries with short paths."""
        return map(self.shorten, stream)

    def shorten(self, entry: JournalEntry) -> JournalEntry:
        """Return an entry with short paths."""
        if entry.kind == RUN_BEGAN:
            self._folders.add(_common_folder(entry.data.get("tree")))
            self._find = self._pattern()
        return entry if entry.kind in _WITHOUT else entry._replace(data=self._short(entry.data))

    def _pattern(self) -> re.Pattern[str]:
        known = sorted({*self._folders, os.path.expanduser("~")} - {"/", "", "~"}, key=len, reverse=True)  # noqa: PTH111 - there may be none
        return re.compile(rf"(?<![\w./~-])({'|'.join(map(re.escape, known))})(/|(?![\w.-]))")

    def _short(self, value: Any) -> Any:
        if isinstance(value, str):
            return self._find.sub(self._told, value) if "/" in value else value
        if isinstance(value, Mapping):
            return {key: self._short(each) for key, each in value.items()}
        return [*map(self._short, value)] if isinstance(value, list | tuple) else value

    def _told(self, found: re.Match[str]) -> str:
        folder, slash = found.groups()
        if folder in self._folders:
            return "" if slash else "."
        return f"~{slash}"


def _common_folder(tree: object) -> str:
    """Return the folder that the files of a tree share; empty if there is none."""
    folders = {os.path.dirname(node.file) for node in tree_nodes(tree) if os.path.isabs(node.file)}  # noqa: PTH117, PTH120 - of another machine
    return os.path.commonpath(folders) if folders else ""
