"""Decoding of a file's bytes into text, with limits on size and encoding."""

import codecs
import os
from pathlib import Path

from sar_compiler.opener import TREE, FileKind
from sar_compiler.tree.diagnostic import Diagnostic, Form, Source, Span, Spans, TreeError

MAX_DEPTH = 200
"""The maximum nesting depth of elements. py_trees halts a tree recursively, with two stack frames per level."""

MAX_ELEMENTS = 300_000
"""The maximum number of elements in a file. The parser rejects a file with more elements."""

MAX_ATTRIBUTES = 1000
"""The maximum number of attributes of an element. It limits the search for names similar to unknown attributes."""

_START = Span(1, 1, 1, 1)
_MARK = "\ufeff"
_BYTE_ORDER_MARKS = [
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
]


def real_path(path: Path) -> Path:
    """Resolve the symbolic links in a path. Circular links and invalid paths stay unchanged."""
    return Path(os.path.abspath(path) if "\0" in str(path) else os.path.realpath(path))  # noqa: PTH100 - pathlib's follows links


def as_written(path: Path) -> Path:
    """Return a path relative to the current folder if the path is inside this folder, else unchanged."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def make_source(
    data: bytes | str, path: str, spans: Spans, declared: str | None, empty_hint: str, kind: FileKind = TREE
) -> Source:
    """Decode a file's content into a `Source`.

    Args:
        data: The content, as bytes or as a decoded string.
        path: The path shown in findings.
        spans: The locator of the parts of elements in the text.
        declared: The encoding that the content declares; None without a declaration.
        empty_hint: The hint for an empty file.
        kind: The file's kind, which limits the size of the content in bytes (or in characters, for a string).

    Raises:
        TreeError: If the content is too large, empty, or not text in its encoding.
    """
    if len(data) > kind.limit:
        message = f"the file is larger than {kind.limit // 2**20} MiB"
        raise TreeError([Diagnostic("file-too-large", message, Source(path, "", spans), _START)])
    encoding = _encoding_of(data, declared) if isinstance(data, bytes) else "utf-8"
    text = data if isinstance(data, str) else _decode(data, path, spans, encoding)
    source = Source(path, text.removeprefix(_MARK), spans, encoding, _MARK if text.startswith(_MARK) else "")
    if not source.text.strip():
        raise TreeError([Diagnostic("empty-file", "the file is empty", source, _START, hint=empty_hint)])
    return source


def encode_text(source: Source, text: str) -> bytes:
    """Encode the new text of a file with the file's encoding and byte order mark.

    In XML, characters that the encoding lacks are written as references (`&#…;`).
    """
    return (source.bom + text).encode(
        source.encoding, "xmlcharrefreplace" if source.form is Form.XML else "strict"
    )


def _encoding_of(data: bytes, declared: str | None) -> str:
    marked = next((name for mark, name in _BYTE_ORDER_MARKS if data.startswith(mark)), None)
    return marked or declared or "utf-8"


def _decode(data: bytes, path: str, spans: Spans, encoding: str) -> str:
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        place = len(data[: error.start].decode(encoding, "replace"))
        message = f"the byte 0x{data[error.start]:02x} is not valid {encoding}"
        raise _wrong_encoding(message, Source(path, data.decode(encoding, "replace"), spans), place) from None
    except (LookupError, UnicodeError):
        message = f"the file declares the encoding '{encoding}', which is not supported"
        raise _wrong_encoding(message, Source(path, data.decode("utf-8", "replace"), spans)) from None
    if "\0" in text:
        message = "the file contains zero bytes and is probably UTF-16 without a byte order mark"
        raise _wrong_encoding(message, Source(path, text, spans), text.index("\0"))
    return text


def _wrong_encoding(message: str, source: Source, place: int = 0) -> TreeError:
    span = source.span(place, place + 1)
    return TreeError([Diagnostic("wrong-encoding", message, source, span, hint="save the file as UTF-8")])
