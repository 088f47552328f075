"""Reading a text in whose place another one was read before: most keystrokes change the attributes of one tag."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple
from xml.parsers import expat

from sar_compiler.opener import TREE
from sar_compiler.tree.content import MAX_ATTRIBUTES
from sar_compiler.tree.diagnostic import Form, Source
from sar_compiler.tree.gathering import parse_tree
from sar_compiler.tree.gc_pause import gc_paused
from sar_compiler.tree.model import Element, Retyped, TreeFile, last_before
from sar_compiler.tree.xml_recovery import NAME, TAG_END, attributes_end


class TextReader:
    """Reads the texts of files that are typed, each in the place of the one before."""

    def __init__(self) -> None:
        self._last: dict[str, TreeFile] = {}

    def read(self, text: str, path: str) -> TreeFile:
        """Read a text; arguments and errors as those of `parse_tree`."""
        before = self._last.get(path)
        if before is None or before.source.text != text:
            found = retyped(before, text) if before is not None else None
            self._last[path] = found or parse_tree(text, path)
        return self._last[path]

    def forget(self, path: str) -> None:
        """Forget a file that is not typed any more."""
        self._last.pop(path, None)


class Edit(NamedTuple):
    """One piece of text in place of another.

    Attributes:
        start: The offset of the first character that goes.
        end: The offset behind the last one.
        length: The number of characters that come.
    """

    start: int
    end: int
    length: int

    @property
    def growth(self) -> int:
        """By how many characters the text grows."""
        return self.length - (self.end - self.start)


def edit_between(old: str, new: str) -> Edit:
    """Return the smallest edit that makes one text of another."""
    most = min(len(old), len(new))
    start = _most(most, lambda low, high: old[low:high] == new[low:high])
    ends = len(old), len(new)
    behind = _most(
        most - start,
        lambda low, high: old[ends[0] - high : ends[0] - low] == new[ends[1] - high : ends[1] - low],
    )
    return Edit(start, len(old) - behind, len(new) - behind - start)


def _most(limit: int, are_alike: Callable[[int, int], bool]) -> int:
    """Return how many characters of two texts are alike, up to a limit, given whether those from one number to another are."""
    alike, different = 0, limit + 1
    while different - alike > 1:
        middle = (alike + different) // 2
        if are_alike(alike, middle):
            alike = middle
        else:
            different = middle
    return alike


class _StartTag(NamedTuple):
    """Where a start tag ends.

    Attributes:
        name_end: The offset behind its name.
        end: The offset behind all of it.
        closing: What closes it: `>` or `/>`.
    """

    name_end: int
    end: int
    closing: str


def retyped(before: TreeFile, text: str) -> TreeFile | None:
    """Return a file as it is read from a text that differs from the one before in the attributes of one tag, within a line.

    Returns:
        The file, equal to what `parse_tree` returns; None if more is different, or that cannot be told.
    """
    source = before.source
    if source.form is not Form.XML or before.findings or source.bom or len(text) > TREE.limit:
        return None
    edit = edit_between(source.text, text)
    went, came = source.text[edit.start : edit.end], text[edit.start : edit.start + edit.length]
    if any(character in part for part in (went, came) for character in "<>\r\n"):
        return None
    place = source.place(edit.start)
    path = _path_to(before.root, place)
    attributes = _attributes_after(path[-1], text, edit)
    if attributes is None:
        return None
    *around, old = (dataclasses.replace(each, children=()) for each in path)
    with gc_paused(len(text)):
        root = _copied(before.root, Source(source.path, text, source.spans))
    _path_to(root, old.place)[-1].attributes = attributes
    # A start tag may go on in further lines: what moves stands in the line of the edit.
    _move(root, place, edit.growth)
    new = dataclasses.replace(old, attributes=attributes)
    return TreeFile(root.source, root, before.comments, retyped=Retyped(tuple(around), old, new))


def _path_to(root: Element, place: tuple[int, int]) -> list[Element]:
    """Return the last element that begins at a place or before it, behind those around it."""
    path = [root]
    while (inner := last_before(path[-1].children, place)) is not None:
        path.append(inner)
    return path


def _copied(element: Element, source: Source) -> Element:
    children = tuple([_copied(child, source) for child in element.children]) if element.children else ()
    return Element(
        element.tag,
        element.attributes,
        children,
        source,
        element.line,
        element.column,
        element.text,
        element.comments,
    )


def _move(root: Element, place: tuple[int, int], growth: int) -> None:
    """Move the elements that begin behind a place in its line."""
    line, column = place
    end = root.source.line(line).find("<", column)
    for each in root.iterate() if end >= 0 else ():
        if each.line == line and each.column > column:
            each.column += growth


def _attributes_after(element: Element, text: str, edit: Edit) -> dict[str, str] | None:
    """Return what the attributes of an element are after an edit; None if something else may have changed."""
    start = element.offset
    old, new = _start_tag(element.source.text, start), _start_tag(text, start)
    if old is None or new is None:
        return None
    is_within = old.name_end <= edit.start and edit.end <= old.end - len(old.closing)
    if not is_within or new != _StartTag(old.name_end, old.end + edit.growth, old.closing):
        return None
    tag = text[start : new.end]
    return _read_tag(tag if new.closing == "/>" else f"{tag}</{element.tag}>")


def _start_tag(text: str, start: int) -> _StartTag | None:
    name = NAME.match(text, start)
    if name is None:
        return None
    closing = TAG_END.match(text, attributes_end(text, name.end()))
    return _StartTag(name.end(), closing.end(), closing[0].strip()) if closing is not None else None


def _read_tag(text: str) -> dict[str, str] | None:
    """Return the attributes of a text that is one element with nothing in it; None if it is anything else."""
    found: list[dict[str, str]] = []
    content: list[str] = []
    parser = expat.ParserCreate(encoding="utf-8")
    parser.StartElementHandler = lambda _tag, attributes: found.append(attributes)
    parser.CharacterDataHandler = content.append
    try:
        parser.Parse(text.encode("utf-8", "surrogatepass"), True)  # noqa: FBT003
    except expat.ExpatError:
        return None
    return found[0] if len(found) == 1 and not content and len(found[0]) <= MAX_ATTRIBUTES else None
