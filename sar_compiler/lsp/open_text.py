"""The text of an open file, and the findings about this text. Each edit updates the positions of findings.

While a tag is incomplete, most of a file cannot be parsed, and the findings would vanish until the tag is closed.
Therefore, the findings about the last parsed text remain, except for findings whose text was edited.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from sar_compiler.project import ProjectTree
from sar_compiler.tree.content import real_path
from sar_compiler.tree.diagnostic import Diagnostic, Form, Severity
from sar_compiler.tree.discovery import FORMS, is_other_file_type


class Edit(NamedTuple):
    """The replacement of a part of a text.

    Attributes:
        start: The offset of the first character to remove.
        end: The offset after the last character to remove.
        length: The number of inserted characters.
    """

    start: int
    end: int
    length: int

    @property
    def growth(self) -> int:
        """The number of characters by which the text grows."""
        return self.length - (self.end - self.start)


def edit_between(old: str, new: str) -> Edit:
    """Return the smallest edit that changes one text into another."""
    most = min(len(old), len(new))
    start = _common_length(most, lambda low, high: old[low:high] == new[low:high])
    ends = len(old), len(new)
    tail = _common_length(
        most - start,
        lambda low, high: old[ends[0] - high : ends[0] - low] == new[ends[1] - high : ends[1] - low],
    )
    return Edit(start, len(old) - tail, len(new) - tail - start)


def _common_length(limit: int, are_alike: Callable[[int, int], bool]) -> int:
    """Return the length of the common prefix of two texts, at most *limit*. *are_alike* compares a range of both."""
    alike, different = 0, limit + 1
    while different - alike > 1:
        middle = (alike + different) // 2
        if are_alike(alike, middle):
            alike = middle
        else:
            different = middle
    return alike


class PlacedFinding(NamedTuple):
    """A finding with its position in the edited text.

    Attributes:
        finding: The finding, with its position in the text that was checked.
        start: The offset of the first character in the edited text.
        end: The offset after the last character in the edited text.
        is_touched: Whether the text at the finding was edited since the check.
    """

    finding: Diagnostic
    start: int
    end: int
    is_touched: bool = False

    @classmethod
    def from_finding(cls, finding: Diagnostic) -> "PlacedFinding":
        """Return a finding with its position in the text that was checked."""
        return cls(finding, *finding.source.offsets(finding.span))

    def after_edit(self, edit: Edit) -> "PlacedFinding":
        """Return a copy of the finding at the position that it has after an edit."""
        if edit.end <= self.start:
            return self._replace(start=self.start + edit.growth, end=self.end + edit.growth)
        if edit.start > self.end:
            return self
        end = max(self.end + edit.growth, edit.start + edit.length)
        return self._replace(start=min(self.start, edit.start), end=end, is_touched=True)


@dataclass
class OpenText:
    """The text of an open file, with the results of its last check.

    Attributes:
        path: The path of the file.
        text: The current text.
        version: The editor's version number of the text.
        shown: The findings about the file, at their positions in the current text.
        elsewhere: The findings about other files, such as included files.
        tree: The last version of the file that could be parsed; None if there is none.
        is_checked: Whether the current text was checked.
        seen: The versions of other open files with which this file was checked, by URI.
    """

    path: Path
    text: str
    version: int | None
    shown: Sequence[PlacedFinding] = ()
    elsewhere: Sequence[Diagnostic] = ()
    tree: ProjectTree | None = None
    is_checked: bool = False
    seen: dict[str, int | None] = field(default_factory=dict, init=False)
    _was_tree: bool = field(default=False, init=False)
    _raised: Sequence[PlacedFinding] = field(default=(), init=False)
    _sound: Sequence[PlacedFinding] = field(default=(), init=False)
    _sound_elsewhere: Sequence[Diagnostic] = field(default=(), init=False)
    _edited: tuple[int, int] | None = field(default=None, init=False)

    @property
    def form(self) -> Form:
        """The format of the file."""
        return FORMS.get(self.path.suffix.lower(), Form.XML)

    def is_foreign(self) -> bool:
        """Return whether the file has never been a tree file since it was opened."""
        is_other = is_other_file_type(self.text, self.form)
        self._was_tree = self._was_tree or bool(self.text.strip() and not is_other)
        return is_other and not self._was_tree

    @property
    def current_tree(self) -> ProjectTree | None:
        """The tree parsed from the current text. None if the text is invalid or has not been checked yet."""
        return self.tree if self.tree is not None and self.tree.source.text == self.text else None

    def change(self, text: str, version: int | None) -> None:
        """Store a new text, and move each finding to the corresponding position in this text."""
        edit = edit_between(self.text, text)
        self.text, self.version, self.is_checked = text, version, False
        self.shown = [each.after_edit(edit) for each in self.shown]
        self._sound = [each.after_edit(edit) for each in self._sound]
        self._raised = [each.after_edit(edit) for each in self._raised]
        self._edited = self._edited_region(edit)

    def _edited_region(self, edit: Edit) -> tuple[int, int]:
        """Return the region of the last edits: *edit*, joined with the previous region if the two are adjacent."""
        start, end = edit.start, edit.start + edit.length
        if self._edited is None or edit.end < self._edited[0] or edit.start > self._edited[1]:
            return start, end
        return min(start, self._edited[0]), max(end, self._edited[1] + edit.growth)

    def mark_complete(self) -> None:
        """Treat the text as complete, for example because the file was saved."""
        self._edited = None

    def set_findings(self, tree: ProjectTree | None, findings: Iterable[Diagnostic]) -> None:
        """Store the findings of a check of the current text.

        Args:
            tree: The checked file; None if the configuration of its project has errors.
            findings: The findings about this file and about other files.
        """
        findings = list(findings)
        own = real_path(self.path)
        found = [
            PlacedFinding.from_finding(each) for each in findings if real_path(Path(each.source.path)) == own
        ]
        elsewhere = [each for each in findings if real_path(Path(each.source.path)) != own]
        self.is_checked = True
        if tree is not None and not tree.is_malformed:
            self.tree = tree
        if self._is_half_typed(tree, found):
            new = {(each.finding.code, each.start) for each in found}
            former = [each for each in self._sound if not each.is_touched]
            found += [each for each in former if (each.finding.code, each.start) not in new]
            elsewhere = list(dict.fromkeys([*elsewhere, *self._sound_elsewhere]))
        else:
            self._sound, self._sound_elsewhere = found, elsewhere
        # The findings about errors in ticks remain until runs are explored again.
        found += [each for each in self._raised if not each.is_touched]
        self.shown, self.elsewhere = sorted(found, key=lambda each: each.start), elsewhere

    def set_tick_errors(self, findings: Iterable[Diagnostic]) -> None:
        """Store the findings about errors that ticks of the current tree raise."""
        before = {id(each.finding) for each in self._raised}
        own = real_path(self.path)
        self._raised = [
            PlacedFinding.from_finding(each) for each in findings if real_path(Path(each.source.path)) == own
        ]
        others = [each for each in self.shown if id(each.finding) not in before]
        self.shown = sorted([*others, *self._raised], key=lambda each: each.start)

    def _is_half_typed(self, tree: ProjectTree | None, found: Iterable[PlacedFinding]) -> bool:
        """Return whether the errors are probably caused by text that the user is still typing."""
        if tree is not None and tree.is_malformed:
            return True
        if self._edited is None:
            return False
        first, last = self._edited
        return any(
            each.finding.severity is Severity.ERROR and each.start <= last and each.end >= first
            for each in found
        )
