"""Discovery and reading of tree files, by path, by name, or in folders."""

import itertools
import os
import re
from collections.abc import Iterator
from pathlib import Path

from sar_compiler import resources
from sar_compiler.opener import (
    STANDARD_INPUT,
    TREE,
    MissingFileError,
    UnreadableFileError,
    folder_entries,
    is_file,
    is_folder,
    is_there,
    matching_paths,
    read_file,
)
from sar_compiler.tree.diagnostic import Form
from sar_compiler.tree.model import TreeFile

FORMS = {".xml": Form.XML, ".yaml": Form.YAML, ".yml": Form.YAML}
"""The formats of tree files by file extension."""


def read_tree_file(path: str | Path) -> TreeFile:
    """Read a tree file.

    The extension `.xml`, `.yaml` or `.yml` determines the format. A file with another extension is XML if it begins with `<`.

    Raises:
        UnreadableFileError: If the file is missing or cannot be read.
        TreeError: If the file cannot be parsed.
    """
    return parse_tree(read_file(path, TREE).data, str(path))


def parse_tree(data: bytes | str, path: str) -> TreeFile:
    """Parse the content of a tree file.

    Args:
        data: The content: bytes, or a decoded string, for example from an editor.
        path: The file's path, whose extension determines the format.

    Raises:
        TreeError: If the content cannot be parsed.
    """
    # Each format imports its own library, and most runs need only one format.
    if _form_of(Path(path), data) is Form.XML:
        from sar_compiler.tree.xml import parse_xml

        return parse_xml(data, path)
    from sar_compiler.tree.yaml import parse_yaml

    return parse_yaml(data, path)


def _form_of(path: Path, content: bytes | str) -> Form:
    by_name = FORMS.get(path.suffix.lower())
    if by_name is not None:
        return by_name
    data = content.encode("utf-8", "replace") if isinstance(content, str) else content
    # A byte order mark, or the zero bytes of UTF-16, may surround the first character.
    return Form.XML if data.lstrip(b"\xef\xbb\xbf\xff\xfe\0 \t\r\n").startswith(b"<") else Form.YAML


SKIPPED = ("build", "install", "log")
"""The names of colcon's output folders. Neither these folders nor hidden folders are searched."""

_BEGINNING = TREE._replace(limit=65_536)
"""The file kind for reading only the first bytes of a file. These bytes suffice to recognise a tree file."""

# The first XML element, after the declaration, comments, a DOCTYPE and text; the first YAML key, after comments.
_FIRST_ELEMENT = rb"(?s)(?:[^<]|<\?.*?\?>|<!--.*?-->|<![^>]*>)*<([\w:.-]+)([^>]*)"
_FIRST_KEY = rb"(?:\s|#[^\n]*\n|---|%[^\n]*\n)*\{?\s*[\"']?root[\"']?\s*:"
_ROOT_ATTRIBUTES = rb"\b(?:BTCPP_format|main_tree_to_execute)\b"
_SECTIONS = rb"\b(?:BehaviorTree|TreeNodesModel|include)\b"
_MODEL, _TREE = (
    rb"(?m)<%s\b|^[ \"']*(?:- *)?%s[\"']?\s*:" % (tag, tag) for tag in (b"TreeNodesModel", b"BehaviorTree")
)
_PROJECT = ".btproj"
"""The file extension of Groot2 projects."""
_ALONE = (b"BehaviorTree", b"TreeNodesModel")


def tree_files_in(folder: Path) -> list[Path]:
    """Return the tree files in a folder and its subfolders, sorted by path.

    Hidden folders and the output folders of colcon are skipped. A folder with several links to it is searched once.

    Raises:
        UnreadableFileError: If a folder or a file cannot be read.
    """
    return sorted(path for path in _files_in(folder) if is_tree_file(path))


def files_around(folder: Path, *, most: int, is_whole: bool) -> list[Path]:
    """Return the files in a folder that may be tree files or palettes by their extension, sorted by path.

    Unreadable files and folders are skipped.

    Args:
        folder: The folder.
        most: The maximum number of files of any kind to examine.
        is_whole: Whether to search the subfolders as well, as `tree_files_in` does.
    """
    found = itertools.islice(_files_in(folder, is_whole=is_whole, is_sought=True), most)
    return sorted(path for path in found if path.suffix.lower() in (*FORMS, _PROJECT) and is_file(path))


def is_palette(path: Path) -> bool:
    """Return whether a tree file or Groot2 project only describes nodes.

    The result is False if the file cannot be read.
    """
    if path.suffix.lower() not in (*FORMS, _PROJECT):
        return False
    try:
        data = read_file(path, TREE).data.replace(b"\0", b"")
    except UnreadableFileError:
        return False
    is_alone = path.suffix.lower() == _PROJECT or not re.search(_TREE, data)
    return is_alone and re.search(_MODEL, data) is not None


def matching_files(folder: Path, pattern: str) -> list[Path]:
    """Return the files that a path or a glob pattern refers to.

    For folders and glob patterns, only tree files are returned. The path of a file is returned without a check.

    Args:
        folder: The folder that the pattern is relative to.
        pattern: The path of a file or a folder, or a glob pattern.

    Raises:
        UnreadableFileError: If a folder or a file cannot be read.
    """
    path = folder / pattern
    if is_folder(path):
        return tree_files_in(path)
    import glob

    if not glob.has_magic(pattern):
        return [path]
    found: list[Path] = []
    for each in matching_paths(str(Path(glob.escape(str(folder))) / pattern)):
        match = Path(each)
        found += tree_files_in(match) if is_folder(match) else [match] if is_tree_file(match) else []
    return list(dict.fromkeys(found))


def is_tree_file(path: Path, *, is_sought: bool = False) -> bool:
    """Return whether a file is a tree file, according to its extension and its outermost element or YAML key.

    Args:
        path: The file.
        is_sought: Whether a search has found the file. An unreadable file then yields False instead of an error.

    Raises:
        UnreadableFileError: If the file cannot be read and *is_sought* is False.
    """
    form = FORMS.get(path.suffix.lower())
    if form is None or not is_file(path):
        return False
    try:
        beginning = read_file(path, _BEGINNING).data
    except UnreadableFileError:
        if is_sought:
            return False
        raise
    # A byte order mark and the zero bytes of UTF-16 are irrelevant here.
    data = beginning.lstrip(b"\xef\xbb\xbf\xff\xfe").replace(b"\0", b"")
    if form is Form.YAML:
        return re.match(_FIRST_KEY, data) is not None and re.search(_SECTIONS, data) is not None
    first = re.match(_FIRST_ELEMENT, data)
    if first is None:
        return False
    tag, attributes = first.groups()
    is_root = re.search(_ROOT_ATTRIBUTES, attributes) is not None
    return is_root or tag in _ALONE or (tag == b"root" and re.search(_SECTIONS, data) is not None)


def is_other_file_type(text: str, form: Form) -> bool:
    """Return whether a text is certainly neither a tree file nor the beginning of one."""
    data = text[: _BEGINNING.limit].lstrip("\ufeff").encode("utf-8", "replace")
    if form is Form.YAML:
        return bool(data.strip()) and re.match(_FIRST_KEY, data) is None
    first = re.match(_FIRST_ELEMENT, data)
    if first is None:
        return False
    tag, attributes = first.groups()
    return tag not in (b"root", *_ALONE) and re.search(_ROOT_ATTRIBUTES, attributes) is None


def _files_in(folder: Path, *, is_whole: bool = True, is_sought: bool = False) -> Iterator[Path]:
    waiting, seen = [folder], set()
    while waiting:
        here = waiting.pop()
        place = os.path.realpath(here)
        if place in seen:
            continue
        seen.add(place)
        try:
            entries = folder_entries(here)
        except UnreadableFileError:
            if is_sought:
                continue
            raise
        for entry in entries:
            if entry.name.startswith("."):
                continue
            if is_folder(entry):
                waiting += [entry] if is_whole and entry.name not in SKIPPED else []
            else:
                yield entry


def path_for_name(name: str) -> Path:
    """Return the path of a tree, given the name or path that the user has written.

    Raises:
        UnreadableFileError: If *name* is empty. An empty path would mean the current folder.
    """
    if not name:
        raise UnreadableFileError(Path(), "its name is empty", "the name of the tree file is empty")
    return Path(name)


def find_tree(name: str) -> Path:
    """Return the tree file for a path or a name.

    Args:
        name: The path of a tree file, or the name of a shipped tree.

    Returns:
        The path of the file. If *name* is clearly a path, the file may be missing.

    Raises:
        UnreadableFileError: If *name* is empty, or a bare word that is neither a file nor a shipped tree.
    """
    if path_for_name(name) == STANDARD_INPUT:
        return STANDARD_INPUT
    path = resources.find("trees", name, ".xml")
    if resources.is_shipped_name(name) and not is_there(path):
        raise MissingFileError(
            path, "there is no such file", resources.not_found_message("trees", name, ".xml")
        )
    return path
