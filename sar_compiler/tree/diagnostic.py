"""A finding: something wrong in a file, its place, and what to write instead."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

from sar_compiler.errors import SarError
from sar_compiler.tree.showing import in_one_line, shortened, visible
from sar_compiler.tree.source import Source, Span

if TYPE_CHECKING:
    from sar_compiler.tree.model import FileBeginning

WIDTH = 128
"""The width of a finding as text, where nothing says how wide it may be."""

_MARGIN, _LEAST = 8, 40
"""The columns before an excerpt, and the fewest characters that are shown of a long line."""


class Severity(str, Enum):
    """The severity of a finding."""

    ERROR = "error"
    WARNING = "warning"
    INFO = "info"


AS_DECLARED: Any = None
"""In place of a severity: the one that the kind of the finding is declared with."""


def _plain(text: str, _part: str) -> str:
    return text


class Cause(NamedTuple):
    """What findings with several messages come of: one thing to do about all of them.

    Attributes:
        text: What is wrong with all of their subjects, as the beginning of a sentence that lists them.
        subject: What this finding is about: a name of the file.
    """

    text: str
    subject: str


class Advice(TypedDict, total=False):
    """What a finding has besides its kind, its message and its place; see `Diagnostic`."""

    suggestion: str | None
    hint: str | None
    severity: Severity
    common_cause: Cause | None


@dataclass(frozen=True)
class Diagnostic:
    """One finding.

    Making one of a code that is not declared raises a `KeyError`.

    Attributes:
        code: Its kind, declared in `tree.kinds`.
        message: What is wrong, in the reader's words.
        source: The file.
        span: Its place.
        suggestion: The text to put in its place, where that can be guessed.
        hint: What to do about it, in a few words, where there is no such text.
        severity: Its severity; given only where this one is worse than its kind, or not as bad.
        common_cause: What it comes of, if findings with other messages come of the same.
    """

    code: str
    message: str
    source: Source
    span: Span
    suggestion: str | None = None
    hint: str | None = None
    severity: Severity = AS_DECLARED
    common_cause: Cause | None = None

    def __post_init__(self) -> None:
        # Most files have no finding, and need not wait for the kinds.
        from sar_compiler.tree.kinds import SEVERITIES

        declared = SEVERITIES[self.code]
        object.__setattr__(self, "severity", self.severity or declared)
        # A value that is quoted may be as long as a file.
        object.__setattr__(self, "message", shortened(self.message))
        object.__setattr__(self, "hint", self.hint and shortened(self.hint))

    @property
    def identity(self) -> tuple[object, ...]:
        """What it has in common with the same finding of another check: a file may be included by several."""
        return self.source.path, self.span, self.code, self.message

    @property
    def cause(self) -> str:
        """What it comes of, equal for all findings that come of the same."""
        return f"{self.code}: {self.common_cause.text if self.common_cause else self.message}"

    @property
    def advice(self) -> str:
        """The advice on what to write or do instead; empty if there is none."""
        if not self.suggestion:
            return self.hint or ""
        quote = next((mark for mark in "'\"`" if mark not in self.suggestion), "")
        return f"did you mean {quote}{shortened(self.suggestion)}{quote}?"

    def render(self, width: int = WIDTH, paint: Callable[[str, str], str] = _plain) -> str:
        """Return the finding as text: place, message, the line itself with carets, the suggestion.

        Args:
            width: The columns that there are for the line.
            paint: Colours a text by what it is: `place`, `error`, `warning`, `info`, `margin`, `carets`, `advice`.
        """
        span, severity = self.span, self.severity.value
        place = paint(in_one_line(f"{self.source.path}:{span.line}:{span.column}:"), "place")
        head = f"{place} {paint(f'{severity}[{self.code}]', severity)}: {in_one_line(self.message)}"
        line, most = self.source.line(span.line), max(width - _MARGIN, _LEAST)
        advice = paint(in_one_line(self.advice), "advice")
        empty = paint("      |", "margin")
        if not line.strip():
            return f"{head}\n{empty} {advice}" if advice else head
        start = span.column - 1
        end = span.end_column - 1 if span.end_line == span.line else len(line)
        if line[start : start + 1] == "<" and end > start + 1:
            start += 1  # the carets stand under the tag's name
        if len(line) > most:
            left = max(0, min(start - most // 2, len(line) - most))
            line, start, end = line[left : left + most], start - left, min(end - left, most)
        before, marked = visible(line[:start]), visible(line[start:end])
        line = f"{before}{marked}{visible(line[end:])}"
        # A tab stays a tab, so that the carets stand right at any tab width.
        indent = "".join("\t" if character == "\t" else " " for character in before)
        carets = paint("^" * max(1, end - start, len(marked)), "carets")
        number = paint(f"{span.line:5} |", "margin")
        return f"{head}\n{number} {line}\n{empty} {indent}{carets} {advice}".rstrip()


class TreeError(SarError):
    """A tree file that cannot be used.

    Attributes:
        findings: Everything that is wrong with it.
        beginning: What it says before the place where it goes wrong; None where that is not known.
    """

    def __init__(self, findings: Iterable[Diagnostic], beginning: "FileBeginning | None" = None) -> None:
        self.findings = tuple(findings)
        self.beginning = beginning
        super().__init__("\n".join(finding.render() for finding in self.findings))


class UnreadableFileError(SarError):
    """A file does not exist, or cannot be read."""
