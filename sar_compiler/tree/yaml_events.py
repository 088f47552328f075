"""The events of a YAML text, with lookahead and comments. Features that XML lacks are rejected.

libyaml parses the text (or PyYAML, if libyaml is missing). Scalars are used as they are written: `no`, `12:30` and
`1e3` are never converted.
"""

import functools
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from sar_compiler.tree.content import MAX_DEPTH
from sar_compiler.tree.diagnostic import LINE_END, Advice, Diagnostic, Source, TreeError
from sar_compiler.tree.model import yaml_comment_text
from sar_compiler.tree.yaml_fields import end_of_block, mask, unmask

if TYPE_CHECKING:
    from typing_extensions import Unpack


_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

# Characters that YAML allows only as escapes, and characters that only some parsers treat as line ends.
_UNREADABLE = re.compile(
    "[^\t\n\r\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]"
)
# Each element takes three levels: its list, the mapping with its tag, and its attributes. Deeper files are never valid.
_MAX_NESTING = 3 * (MAX_DEPTH + 2)
_COMMENT = re.compile(r"#([^\r\n]*)")
_COMMENT_BEHIND = re.compile(r"[ \t]+#[^\r\n]*")


@dataclass
class PendingComment:
    """A comment on its own lines that is not yet assigned to an element.

    Attributes:
        column: The column of the `#`, from 1.
        end: The offset of the comment's end.
        lines: The text after each `#`.
        after_blank_line: Whether a blank line precedes the comment. It is False after another pending comment.
    """

    column: int
    end: int
    lines: list[str]
    after_blank_line: bool

    @property
    def text(self) -> str:
        """The text of the comment."""
        return yaml_comment_text(self.lines)


class YamlEvents:
    """The events of a text, with one event of lookahead.

    Attributes:
        findings: The findings so far; the consumer of the events adds further findings.
        next: The next event.
        trailing: The text of the comment on the line of the last popped event; None if there is no comment.
        is_cut: Whether the events have ended early, at a syntax error.

    Args:
        source: The text.
        closing: If true, the events end at a syntax error, after all open collections have been closed. If false, the
            error is raised.
    """

    def __init__(self, source: Source, *, closing: bool = False) -> None:
        self.is_cut = False
        self._closing = closing
        self.findings: list[Diagnostic] = []
        self.trailing: str | None = None
        self._source = source
        self._waiting: list[PendingComment] = []
        self._has_comments = "#" in source.text
        self._end = 0
        self._nested = 0
        unreadable = _UNREADABLE.search(source.text)
        if unreadable:
            code = ord(unreadable.group())
            message = f"the character U+{code:04X} is not allowed in YAML unless it is escaped"
            hint = f'delete it, or write "\\u{code:04x}" in double quotes'
            self.report_finding("wrong-character", message, *unreadable.span(), hint=hint)
            raise TreeError(self.findings)
        self._text = mask(source.text) if closing else source.text
        self._is_masked = self._text != source.text
        self._stream: Iterator[Any] = yaml.parse(self._text, Loader=_LOADER)
        self.next: Any = None
        self.pop()

    def report_finding(
        self, code: str, message: str, start: int, end: int, **advice: "Unpack[Advice]"
    ) -> None:
        """Add a finding about the text between two offsets. After a syntax error, do nothing."""
        if self.is_cut:
            return
        span = self._source.span(start, max(start + 1, end))
        self.findings.append(Diagnostic(code, message, self._source, span, **advice))

    def pop(self) -> Any:
        """Return the next event, and read the event after it.

        Raises:
            TreeError: If the text of the event after it is not well-formed, and *closing* is False.
        """
        taken = self.next
        try:
            self.next = event = next(self._stream, None)
        except yaml.YAMLError as error:
            self.findings.append(syntax_finding(self._source, error))
            if not self._closing:
                raise TreeError(self.findings) from None
            self.is_cut = True
            self._stream = self._closing_events()
            self.next = event = next(self._stream)
        self.trailing = None
        if event is not None:
            if self._is_masked and isinstance(event, yaml.ScalarEvent):
                event.value = unmask(event.value)
            if isinstance(event, yaml.CollectionStartEvent):
                self._enter(event)
            elif isinstance(event, yaml.CollectionEndEvent):
                self._nested -= 1
            if self._has_comments:
                self._collect(taken, event)
            if getattr(event, "anchor", None) is not None or getattr(event, "tag", None) is not None:
                self._report_anchor_or_tag(event)
        return taken

    def _closing_events(self) -> Iterator[Any]:
        """Yield the events that close the open collections at a syntax error."""
        # For each open collection: the event that ends it, and whether the value of a key comes next.
        opened: list[tuple[Any, bool]] = []
        mark: Any = yaml.Mark("", 0, 0, 0, None, 0)
        with suppress(yaml.YAMLError):
            for event in yaml.parse(self._text, Loader=_LOADER):
                mark = event.end_mark
                if isinstance(event, yaml.CollectionEndEvent):
                    opened.pop()
                if isinstance(event, yaml.CollectionStartEvent):
                    is_mapping = isinstance(event, yaml.MappingStartEvent)
                    opened.append((yaml.MappingEndEvent if is_mapping else yaml.SequenceEndEvent, False))
                elif opened and isinstance(event, yaml.NodeEvent | yaml.CollectionEndEvent):
                    end, is_value = opened[-1]
                    opened[-1] = end, not is_value
        while opened:
            end, is_value = opened.pop()
            if end is yaml.MappingEndEvent and is_value:
                yield yaml.ScalarEvent(None, None, (True, False), "", mark, mark)
            yield end(mark, mark)
            if opened:  # either a key has ended and its value comes next, or a value has ended
                end, is_value = opened[-1]
                opened[-1] = end, not is_value
        yield yaml.DocumentEndEvent(mark, mark)
        yield yaml.StreamEndEvent(mark, mark)

    def skip(self) -> int:
        """Skip the next value, whatever its kind, and return the offset of the value's end."""
        depth = end = 0
        while True:
            event = self.pop()
            if isinstance(event, yaml.CollectionStartEvent):
                depth += 1
            elif isinstance(event, yaml.CollectionEndEvent):
                depth -= 1
            at = event.start_mark.index, event.end_mark.index
            if isinstance(event, yaml.ScalarEvent) and event.style in ("|", ">"):
                end = end_of_block(self._source.text, *at, event.value)
            elif isinstance(event, yaml.ScalarEvent) or at[0] < at[1]:
                # The end event of a block has no characters, and is at the beginning of the next token.
                end = at[1]
            if depth == 0:
                return end

    def comments(self, from_column: int = 0) -> list[PendingComment]:
        """Return the comments before the next event, and clear them.

        Args:
            from_column: From the first comment that begins before this column, all comments are kept for other elements.
        """
        waiting = self._waiting
        count = next((i for i, one in enumerate(waiting) if one.column < from_column), len(waiting))
        self._waiting = waiting[count:]
        return waiting[:count]

    def skip_fields(self) -> tuple[int, PendingComment | None]:
        """Skip a list or mapping. Comments and tags in it are part of its text.

        Returns:
            The end offset of the list or mapping, and the comment on the line of the closing bracket (None without such
            a comment).
        """
        is_block, found = not self.next.flow_style, len(self.findings)
        start = self.next.start_mark.index
        end = self.skip()
        of_the_last = _COMMENT_BEHIND.match(self._source.text, end)
        if is_block and of_the_last is not None:
            end = of_the_last.end()
        tags = [one for one in self.findings[found:] if one.code == "yaml-tag"]
        inside = self._source.span(start, end)
        for one in tags:
            if inside[:2] <= one.span[:2] < inside[2:]:
                self.findings.remove(one)
        self._waiting = [one for one in self._waiting if one.end > end]
        return end, self._waiting.pop(0) if not is_block and of_the_last is not None else None

    def _enter(self, event: Any) -> None:
        self._nested += 1
        if self._nested > _MAX_NESTING:
            message = f"lists and mappings are nested more than {_MAX_NESTING} levels deep"
            self.report_finding("too-deep", message, event.start_mark.index, event.start_mark.index)
            raise TreeError(self.findings)

    def _collect(self, taken: Any, event: Any) -> None:
        """Collect the comments between the end of the previous event and the beginning of *event*."""
        start, self._end = self._end, max(self._end, event.start_mark.index)
        follows = isinstance(taken, yaml.ScalarEvent) and taken.style not in ("|", ">")
        for match in _COMMENT.finditer(self._source.text, start, self._end):
            if (
                follows
                and self.trailing is None
                and not LINE_END.search(self._source.text, start, match.start())
            ):
                self.trailing = yaml_comment_text([match.group(1)])
            else:
                self._add_pending(match)
        if isinstance(event, yaml.ScalarEvent) or getattr(event, "flow_style", False):
            self._end = max(self._end, event.end_mark.index)

    def _add_pending(self, match: re.Match[str]) -> None:
        column = self._source.position_of(match.start())[1]
        last = self._waiting[-1] if self._waiting else None
        if last is not None:
            between = self._source.text[last.end : match.start()]
            if last.column == column and not between.strip() and len(LINE_END.findall(between)) == 1:
                last.lines.append(match.group(1))
                last.end = match.end()
                return
        # A blank line after another pending comment only separates the two comments.
        after_blank_line = self._source.has_blank_line_before(match.start()) and last is None
        self._waiting.append(PendingComment(column, match.end(), [match.group(1)], after_blank_line))

    def _report_anchor_or_tag(self, event: Any) -> None:
        start = event.start_mark.index
        if event.anchor is not None:
            mark = "*" if isinstance(event, yaml.AliasEvent) else "&"
            written, what = f"{mark}{event.anchor}", "alias" if mark == "*" else "anchor"
            message = f"'{written}' is a YAML {what}, which is not allowed here"
            hint = f"write the value itself, or put a string that begins with {mark} in quotes"
            self.report_finding("yaml-anchor", message, start, start + len(written), hint=hint)
        else:
            end = start + len(self._source.text[start : start + 80].split(maxsplit=1)[0])
            message = f"'{self._source.text[start:end]}' is a YAML tag, which is not allowed here"
            hint = "delete the tag, or put a string that begins with ! in quotes"
            self.report_finding("yaml-tag", message, start, end, hint=hint)


def masked_events(text: str) -> Iterator[Any]:
    """Yield the YAML events of a valid tree file. Special characters are masked as in `YamlEvents`."""
    yield from yaml.parse(mask(text), Loader=_LOADER)


def syntax_finding(source: Source, error: yaml.YAMLError) -> Diagnostic:
    """Return the finding for a text that the YAML parser rejects."""
    problem, start = str(error), 0
    if isinstance(error, yaml.MarkedYAMLError):
        problem = f"{error.problem}"
        mark = error.problem_mark or error.context_mark
        start = min(mark.index, len(source.text)) if mark is not None else 0
        if error.context_mark is not None and re.search(r"quoted|flow|simple key", error.context or ""):
            start = error.context_mark.index if "escape" not in problem else start
            problem = f"{problem} {error.context}" if "flow" in (error.context or "") else problem
    message, hint = _reword_problem(source.text[start : start + 1], problem)
    span = source.span(start, min(start + 1, len(source.text)))
    return Diagnostic("malformed-yaml", f"not well-formed YAML: {message}", source, span, hint=hint)


@functools.cache
def _rewordings() -> list[dict[str, str]]:
    text = Path(__file__).with_name("yaml_mistakes.yaml").read_text("utf-8")
    return list(yaml.load(text, _LOADER))  # noqa: S506 - a safe one


def _reword_problem(character: str, problem: str) -> tuple[str, str | None]:
    if "cannot start any token" in problem and character != "\t":
        return f"a string cannot begin with {character}", "put it in quotes"
    for words in _rewordings():
        if re.search(words["problem"], "tab" if character == "\t" else problem):
            return words["message"], words.get("hint")
    return problem, None
