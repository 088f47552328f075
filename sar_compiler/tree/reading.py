"""Reading of tree files in any form."""

from pathlib import Path

from sar_compiler.tree.content import read_bytes
from sar_compiler.tree.model import TreeFile
from sar_compiler.tree.source import Form

FORMS = {".xml": Form.XML, ".yaml": Form.YAML, ".yml": Form.YAML}
"""The forms of tree files by their endings."""


def read_tree_file(path: str | Path) -> TreeFile:
    """Read a tree file.

    The file's ending tells its form: `.xml`, `.yaml` or `.yml`; with any other, `<` begins XML.

    Raises:
        UnreadableFileError: If the file is not there or cannot be read.
        TreeError: If it cannot be understood at all.
    """
    return parse_tree(read_bytes(path), str(path))


def parse_tree(data: bytes, path: str) -> TreeFile:
    """Read the content of a tree file.

    Args:
        data: The content.
        path: The file's name, whose ending tells the form.

    Raises:
        TreeError: If it cannot be understood at all.
    """
    # Each form brings its own library along; most runs need one of them.
    if _form_of(Path(path), data) is Form.XML:
        from sar_compiler.tree.xml import parse_xml

        return parse_xml(data, path)
    from sar_compiler.tree.yaml import parse_yaml

    return parse_yaml(data, path)


def _form_of(path: Path, data: bytes) -> Form:
    by_name = FORMS.get(path.suffix.lower())
    if by_name is not None:
        return by_name
    # A byte order mark, or the zero bytes of UTF-16, may stand around the first character.
    return Form.XML if data.lstrip(b"\xef\xbb\xbf\xff\xfe\0 \t\r\n").startswith(b"<") else Form.YAML
