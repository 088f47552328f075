"""The result of the check of a tree file."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import NamedTuple

from sar_compiler.opener import Observation
from sar_compiler.tree.diagnostic import Diagnostic


class TrialOutcome(NamedTuple):
    """The result of exploring the runs of a file within limits.

    Attributes:
        findings: Findings about ticks that raise.
        spent: The work done.
        is_limited: Whether more work could have found more.
        is_cut: Whether its user has stopped it.
    """

    findings: Sequence[Diagnostic] = ()
    spent: int = 0
    is_limited: bool = False
    is_cut: bool = False


class TextFix(NamedTuple):
    """The fix of a finding.

    Attributes:
        number: The index of the finding among those of its file.
        start: As in `checks.fixing.Fix`.
        end: As in `checks.fixing.Fix`.
        text: As in `checks.fixing.Fix`.
    """

    number: int
    start: int
    end: int
    text: str


@dataclass
class FileCheck:
    """The result of the check of a file.

    Attributes:
        palettes: Findings about the palettes of its project.
        findings: Findings about the file, or about the configuration that prevents its check.
        further: The findings of the further checks.
        raised: Findings about ticks that raise.
        fixes: The fixes of its findings.
        fixable: The number of fixes that do not overlap.
        used_palettes: Palettes around it that were used without being named.
        used_trees: Tree files around it that were used without being named.
        notes: Further notes for the user.
        problem: Why the file, or a file that it needs, cannot be read; empty if all could be read.
        spent: The work done to explore its runs.
        is_limited: Whether more work could have found more.
        is_cut: Whether its user has stopped the check.
        is_read: Whether it could be read.
        is_whole: Whether the check is complete.
        sources: The queries of the file system made to read the file and its includes.
    """

    palettes: list[Diagnostic] = field(default_factory=list)
    findings: list[Diagnostic] = field(default_factory=list)
    further: list[Diagnostic] = field(default_factory=list)
    raised: list[Diagnostic] = field(default_factory=list)
    fixes: list[TextFix] = field(default_factory=list)
    fixable: int = 0
    used_palettes: list[str] = field(default_factory=list)
    used_trees: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    problem: str = ""
    spent: int = 0
    is_limited: bool = False
    is_cut: bool = False
    is_read: bool = False
    is_whole: bool = False
    sources: Observation = field(default_factory=Observation)


FINDINGS_OF_A_CHECK = tuple(each.name for each in fields(FileCheck))[:4]
"""The attributes of a `FileCheck` that are findings."""
