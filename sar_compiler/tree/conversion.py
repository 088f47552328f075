"""Conversion of a tree file to another format or to its canonical form. Losses are reported.

The parser skips XML content other than elements, attributes and comments, as BehaviorTree.CPP does. A conversion must
not drop such content silently.
"""

import codecs
import dataclasses
import re
from collections.abc import Iterator
from typing import NamedTuple

from sar_compiler.tree.content import encode_text
from sar_compiler.tree.diagnostic import Diagnostic, Form, Severity, Source, TreeError
from sar_compiler.tree.model import EDITOR_ATTRIBUTES, Comment, Element, TreeFile
from sar_compiler.tree.xml_recovery import readable
from sar_compiler.tree.xml_writer import DECLARATION, comment_in_xml, write_xml
from sar_compiler.tree.yaml_writer import comment_in_yaml, write_yaml

_WRITERS = {Form.XML: write_xml, Form.YAML: write_yaml}
_EDITOR_COMMENT = "yaml-language-server:"


class ConvertedTree(NamedTuple):
    """A converted tree file.

    Attributes:
        text: The content of the converted file.
        losses: A finding for each part of the original file that is missing, changed or moved.
    """

    text: str
    losses: tuple[Diagnostic, ...]


def convert(tree_file: TreeFile, form: Form) -> ConvertedTree:
    """Convert a tree file to XML or YAML.

    Args:
        tree_file: The file.
        form: The target format. The file's own format yields the canonical form, without losses.

    Raises:
        TreeError: If XML content that is not part of the tree would be lost (text, processing instructions),
            or if the target format cannot express an attribute.
    """
    rest = [each for each in tree_file.findings if each.code == "stray-text"]
    rest += ignored_content(tree_file) if tree_file.source.form is Form.XML else ()
    if rest:
        # BehaviorTree.CPP skips stray text; a conversion would lose it.
        raise TreeError(dataclasses.replace(each, severity=Severity.ERROR) for each in rest)
    if tree_file.source.form is form:
        return ConvertedTree(_WRITERS[form](tree_file), ())
    return ConvertedTree(_WRITERS[form](_without_editor_hints(tree_file)), tuple(_losses(tree_file, form)))


def canonical_bytes(tree_file: TreeFile) -> bytes:
    """Return the canonical form of a file. The encoding, byte order mark and line endings are kept.

    They are the choice of the user's project (`.gitattributes`, editor settings).

    Raises:
        TreeError: As for `convert`.
    """
    source = tree_file.source
    text = convert(tree_file, source.form).text
    if source.form is Form.XML:
        text = text.replace(DECLARATION, DECLARATION.replace("UTF-8", _encoding_name(source.encoding)), 1)
    return encode_text(source, text.replace("\n", source.line_end))


def _encoding_name(encoding: str) -> str:
    """Return the name of an encoding for an XML declaration.

    The name of UTF-16 does not depend on the byte order.
    """
    names = {"utf-8": "UTF-8", "utf-16-le": "UTF-16", "utf-16-be": "UTF-16"}
    return names.get(codecs.lookup(encoding).name, encoding)


def _losses(tree_file: TreeFile, form: Form) -> Iterator[Diagnostic]:
    root = tree_file.root
    other = "YAML" if form is Form.YAML else "XML"
    for name in _editor_attributes(root):
        hint = "declare the schema in a comment: '# yaml-language-server: $schema=...'"
        message = f"the attribute '{name}' is only for XML editors and is left out"
        yield root.finding("left-out", message, name=name, hint=hint)
    for element, comment in _comments(tree_file):
        kept = comment_in_yaml(comment.text) if form is Form.YAML else comment_in_xml(comment.text)
        if _EDITOR_COMMENT in comment.text:
            code = "left-out"
            message = f"the comment '{_EDITOR_COMMENT}' is only for YAML editors and is left out"
        elif comment.attribute is not None:
            what = f"in {other}, the comment at the attribute '{comment.attribute}' moves before the element"
            code = "moved"
            message = f"{what}: '{_first_words(comment.text)}'"
        elif kept != comment.text:
            code = "changed"
            message = f"{other} cannot express the comment '{_first_words(comment.text)}' unchanged"
        else:
            continue
        yield element.finding(code, message, name=comment.attribute)


def _comments(tree_file: TreeFile) -> Iterator[tuple[Element, Comment]]:
    for comment in tree_file.comments:
        yield tree_file.root, comment
    for element in tree_file.root.iterate():
        for comment in element.comments:
            yield element, comment


def _editor_attributes(root: Element) -> list[str]:
    return [name for name in root.attributes if name.startswith(EDITOR_ATTRIBUTES)]


def _without_editor_hints(tree_file: TreeFile) -> TreeFile:
    root = tree_file.root
    hints = _editor_attributes(root)
    kept = {name: value for name, value in root.attributes.items() if name not in hints}
    return dataclasses.replace(
        tree_file,
        root=dataclasses.replace(root, attributes=kept),
        comments=tuple(_without_schema(tree_file.comments)),
    )


def _without_schema(comments: tuple[Comment, ...]) -> Iterator[Comment]:
    for comment in comments:
        lines = comment.text.split("\n")
        kept = "\n".join(line for line in lines if not line.startswith(_EDITOR_COMMENT)).strip("\n")
        if kept or kept == comment.text:
            yield dataclasses.replace(comment, text=kept)


def _first_words(text: str) -> str:
    first = text.split("\n", maxsplit=1)[0]
    return first if first == text and len(first) <= 40 else f"{first[:40]}..."  # noqa: PLR2004


_PIECE = re.compile(
    r"<(?P<comment>!--).*?-->|<\?(?P<target>[^\s?]+).*?\?>|<!\[CDATA\[(?P<data>.*?)\]\]>|(?P<end></)[^>]*>"
    r"""|(?P<start><)(?:"[^"]*"|'[^']*'|[^"'>])*>|(?P<text>[^<]+)""",
    re.DOTALL,
)
"""A regular expression for one piece of a well-formed XML document: a comment, an instruction, a tag or a text."""


def ignored_content(tree_file: TreeFile) -> Iterator[Diagnostic]:
    """Yield findings about content that the parser ignores.

    These are all processing instructions, and the first text in each element.
    """
    with_text = {element.offset for element in tree_file.root.iterate() if element.text}
    opened: list[int] = []
    last = -1
    for piece in _PIECE.finditer(readable(tree_file)):
        kind = piece.lastgroup or ""
        start, written = piece.start(kind), piece[kind].strip()
        if kind == "end":
            opened.pop()
        elif kind == "start" and not piece[0].endswith("/>"):
            opened.append(piece.start())
        elif kind == "target" and written != "xml":
            message = f"the processing instruction <?{written}?> is not part of the tree and would be lost"
            yield _report("processing-instruction", message, tree_file.source, f"<?{written}", piece.start())
        elif kind in ("data", "text") and written and opened[-1] != last and opened[-1] not in with_text:
            last = opened[-1]  # once for each element
            start += piece[kind].index(written)
            message = "this text is not part of the tree and would be lost"
            yield _report("stray-text", message, tree_file.source, written.splitlines()[0], start)


def _report(code: str, message: str, source: Source, written: str, start: int) -> Diagnostic:
    span, hint = source.span(start, start + len(written)), "put it in a comment, or delete it"
    return Diagnostic(code, message, source, span, hint=hint)
