"""Load and save a file in the graphical editor, and detect changes of the file on the disk."""

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path

from sar_compiler.opener import TREE, read_file
from sar_compiler.tree.content import encode_text
from sar_compiler.tree.diagnostic import Form, Source, TreeError
from sar_compiler.tree.discovery import FORMS, parse_tree
from sar_compiler.writing import WriteError, write_bytes, write_text

_EMPTY = {
    Form.XML: '<root BTCPP_format="4">\n  <BehaviorTree ID="Main"/>\n</root>\n',
    Form.YAML: "root:\n  BTCPP_format: 4\n  children:\n    - BehaviorTree:\n        ID: Main\n",
}


def create_document(path: Path) -> None:
    """Create a tree file with an empty tree.

    Raises:
        WriteError: If the file exists or cannot be written, or its name does not end with .xml, .yaml or .yml.
    """
    form = FORMS.get(path.suffix.lower())
    if form is None:
        raise WriteError(f"'{path}' does not end with .xml, .yaml or .yml. Choose another name")
    if path.exists():
        raise WriteError(f"{path} already exists. To edit this file, omit --new")
    write_text(path, _EMPTY[form])


class EditedDocument:
    """A file that the page edits.

    Args:
        path: The path of the file.

    Attributes:
        path: The path of the file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._source: Source | None = None
        self._has_crlf = False

    def load(self) -> Mapping[str, object]:
        """Return the text and the version of the file.

        If all lines of the file end with CRLF, the returned text has LF instead, and `save_text` writes CRLF again.

        Raises:
            UnreadableFileError: If the file cannot be read.
            TreeError: If the file is not text.
        """
        data = read_file(self.path, TREE).data
        self._source = source = _source_of(data, self.path)
        self._has_crlf = "\r\n" in source.text and not re.search(r"(?<!\r)\n|\r(?!\n)", source.text)
        text = source.text.replace("\r\n", "\n") if self._has_crlf else source.text
        return {"text": text, "version": _version(data), "name": self.path.name, "form": source.form.value}

    def save_text(self, text: str, version: str, *, overwrite: bool = False) -> Mapping[str, object]:
        """Write the file.

        Args:
            text: The text.
            version: The version that the page has read or written last.
            overwrite: Whether to write the file even if another program has changed it since.

        Returns:
            The new version. If another program has changed the file, `has_changed` is returned and nothing is written.

        Raises:
            UnreadableFileError: If the file cannot be read.
            WriteError: If the file cannot be written.
        """
        if not overwrite and self.is_changed(version):
            return {"has_changed": True}
        source = self._source or _source_of(read_file(self.path, TREE).data, self.path)
        data = encode_text(source, text.replace("\n", "\r\n") if self._has_crlf else text)
        write_bytes(self.path, data)
        return {"version": _version(data)}

    def is_changed(self, version: str) -> bool:
        """Return whether the version of the file on the disk differs from the given version."""
        return _version(read_file(self.path, TREE).data) != version


def _source_of(data: bytes, path: Path) -> Source:
    """Return the text of a file, even if it cannot be parsed.

    Raises:
        TreeError: If the file is not text.
    """
    try:
        return parse_tree(data, str(path)).source
    except TreeError as error:
        if error.findings[0].code in ("wrong-encoding", "file-too-large"):
            raise
        return error.findings[0].source


def _version(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
