"""The text of an open file, and findings that move with it.

While a tag is incomplete, most of a file cannot be parsed, and its findings would vanish until the tag is closed. So the
findings of the last text that could be parsed stay, except those whose own text was edited.
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
    """A replacement of one piece of text.

    Attributes:
        start: The offset of the first character to remove.
        end: The offset after the last one.
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
    """Return the smallest edit from one text to another."""
    most = min(len(old), len(new))
    start = _common_length(most, lambda low, high: old[low:high] == new[low:high])
    ends = len(old), len(new)
    behind = _common_length(
        most - start,
        lambda low, high: old[ends[0] - high : ends[0] - low] == new[ends[1] - high : ends[1] - low],
    )
    return Edit(start, len(old) - behind, len(new) - behind - start)


def _common_length(limit: int, are_alike: Callable[[int, int], bool]) -> int:
    """Return the number of equal characters of two texts up to a limit, given a comparison of ranges."""
    alike, different = 0, limit + 1
    while different - alike > 1:
        middle = (alike + different) // 2
        if are_alike(alike, middle):
            alike = middle
        else:
            different = middle
    return alike


class PlacedFinding(NamedTuple):
    """A finding in an edited text.

    Attributes:
        finding: The original finding.
        start: The offset of its first character.
        end: The offset after its last one.
        is_touched: Whether its own text was edited since.
    """

    finding: Diagnostic
    start: int
    end: int
    is_touched: bool = False

    @classmethod
    def from_finding(cls, finding: Diagnostic) -> "PlacedFinding":
        """Return a finding in the text in which it was found."""
        return cls(finding, *finding.source.offsets(finding.span))

    def after_edit(self, edit: Edit) -> "PlacedFinding":
        """Return its position after an edit."""
        if edit.end <= self.start:
            return self._replace(start=self.start + edit.growth, end=self.end + edit.growth)
        if edit.start > self.end:
            return self
        end = max(self.end + edit.growth, edit.start + edit.length)
        return self._replace(start=min(self.start, edit.start), end=end, is_touched=True)


@dataclass
class OpenText:
    """An edited text with its analysis.

    Attributes:
        path: The file.
        text: The text.
        version: The editor's version number of the text.
        shown: The findings about it, at their present positions.
        elsewhere: The findings about other files, such as those that it includes.
        tree: The file when it was last parsed; None before.
        is_checked: Whether the analysis is of the present text.
        seen: The texts of other open files with which it was checked, by their names.
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
        """Its form."""
        return FORMS.get(self.path.suffix.lower(), Form.XML)

    def is_foreign(self) -> bool:
        """Return whether an open file has never been a tree file."""
        is_other = is_other_file_type(self.text, self.form)
        self._was_tree = self._was_tree or bool(self.text.strip() and not is_other)
        return is_other and not self._was_tree

    @property
    def current_tree(self) -> ProjectTree | None:
        """The parsed file; None while it cannot be parsed."""
        return self.tree if self.tree is not None and self.tree.source.text == self.text else None

    def change(self, text: str, version: int | None) -> None:
        """Store a new text."""
        edit = edit_between(self.text, text)
        self.text, self.version, self.is_checked = text, version, False
        self.shown = [each.after_edit(edit) for each in self.shown]
        self._sound = [each.after_edit(edit) for each in self._sound]
        self._raised = [each.after_edit(edit) for each in self._raised]
        self._edited = self._edited_region(edit)

    def _edited_region(self, edit: Edit) -> tuple[int, int]:
        """Return the region of continued typing, in which adjacent edits are joined."""
        start, end = edit.start, edit.start + edit.length
        if self._edited is None or edit.end < self._edited[0] or edit.start > self._edited[1]:
            return start, end
        return min(start, self._edited[0]), max(end, self._edited[1] + edit.growth)

    def mark_complete(self) -> None:
        """Treat the text as complete, because the file was saved."""
        self._edited = None

    def set_findings(self, tree: ProjectTree | None, findings: Iterable[Diagnostic]) -> None:
        """Store the findings about the present text.

        Args:
            tree: The file; None if its project's configuration has errors.
            findings: The findings in it and in other files.
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
            told = {(each.finding.code, each.start) for each in found}
            stay = [each for each in self._sound if not each.is_touched]
            found += [each for each in stay if (each.finding.code, each.start) not in told]
            elsewhere = list(dict.fromkeys([*elsewhere, *self._sound_elsewhere]))
        else:
            self._sound, self._sound_elsewhere = found, elsewhere
        # The errors of ticks stay until runs are tried again.
        found += [each for each in self._raised if not each.is_touched]
        self.shown, self.elsewhere = sorted(found, key=lambda each: each.start), elsewhere

    def set_tick_errors(self, findings: Iterable[Diagnostic]) -> None:
        """Store the errors of ticks of the present text."""
        before = {id(each.finding) for each in self._raised}
        own = real_path(self.path)
        self._raised = [
            PlacedFinding.from_finding(each) for each in findings if real_path(Path(each.source.path)) == own
        ]
        kept = [each for each in self.shown if id(each.finding) not in before]
        self.shown = sorted([*kept, *self._raised], key=lambda each: each.start)

    def _is_half_typed(self, tree: ProjectTree | None, found: Iterable[PlacedFinding]) -> bool:
        """Return whether new errors result only from an incomplete text."""
        if tree is not None and tree.is_malformed:
            return True
        if self._edited is None:
            return False
        first, last = self._edited
        return any(
            each.finding.severity is Severity.ERROR and each.start <= last and each.end >= first
            for each in found
        )
