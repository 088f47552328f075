"""The rest of an XML file besides elements, attributes and comments: text and processing instructions.

Reading passes over it, as BehaviorTree.CPP does. Whoever writes the file anew must not.
"""

from xml.parsers import expat

from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import TreeFile
from sar_compiler.tree.source import Source
from sar_compiler.tree.xml_recovery import readable


def rest_of(tree_file: TreeFile) -> list[Diagnostic]:
    """Return a finding for each piece of text and each processing instruction that no element has."""
    with_text = {(element.line, element.column) for element in tree_file.root.iterate() if element.text}
    text = readable(tree_file.source) if tree_file.findings else tree_file.source.text
    return _Looker(tree_file.source, with_text).look(text)


class _Looker:
    def __init__(self, source: Source, with_text: set[tuple[int, int]]) -> None:
        self._source = source
        self._with_text = with_text
        self._open: list[tuple[int, int]] = []
        self._findings: list[Diagnostic] = []
        # Text of one line in one element may come in pieces.
        self._last: tuple[int, int] | None = None
        self._parser = parser = expat.ParserCreate(encoding="utf-8")
        parser.buffer_text = True
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._text
        parser.ProcessingInstructionHandler = self._instruction

    def look(self, text: str) -> list[Diagnostic]:
        self._parser.Parse(text.encode(), True)  # noqa: FBT003
        return self._findings

    def _place(self) -> tuple[int, int]:
        return self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1

    def _start(self, _tag: str, _attributes: object) -> None:
        self._open.append(self._place())

    def _end(self, _tag: str) -> None:
        self._open.pop()

    def _text(self, data: str) -> None:
        element = self._open[-1]
        written = data.strip()
        if not written or element in self._with_text or element == self._last:
            return
        self._last = element
        line, start = written.split("\n", maxsplit=1)[0], self._source.offset(*element)
        message = "this text is no part of the tree, and writing the file anew would lose it"
        self._report("stray-text", message, max(self._source.text.find(line, start), start), len(line))

    def _instruction(self, target: str, _data: str) -> None:
        message = f"the processing instruction <?{target}?> is no part of the tree, and would be lost"
        self._report("processing-instruction", message, self._source.offset(*self._place()), len(target) + 2)

    def _report(self, code: str, message: str, start: int, length: int) -> None:
        span = self._source.span(start, start + length)
        hint = "put it in a comment, or delete it"
        self._findings.append(Diagnostic(code, message, self._source, span, hint=hint))
