"""Checks the hash chain of a journal to find out whether the journal was altered."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.journal.journal_entries import day_and_time
from sar_compiler.tree.display_text import escape_to_one_line
from sar_compiler.tree.plain import count_with_noun

if TYPE_CHECKING:
    from sar_compiler.journal.chain import ChainEntry, JournalChain
    from sar_compiler.journal.database import JournalFile

_NOT_KNOWN = "Without --head HEX, a recomputed or truncated chain cannot be detected. The head is in the run's summary and in reports"
_OMITTED = ("what", "data", "link")


class CheckedJournal(NamedTuple):
    """The result of checking a journal.

    Attributes:
        file: The path of the journal.
        state: `whole`, `open` (unaltered, but the last run has no end), `altered` or `other head`.
        words: The state in words that follow the journal's name, such as `is unaltered: …`.
        chain: The result for the hash chain; None if it was not checked.
        notes: Sentences that say what the check cannot detect.
    """

    file: Path
    state: str
    words: str
    chain: "JournalChain | None" = None
    notes: tuple[str, ...] = ()

    @classmethod
    def check(cls, place: Path, expected: str | None) -> "CheckedJournal":
        """Check whether a journal was altered, and return the result.

        Args:
            place: The path of the journal.
            expected: The head that the chain must have; None if this head is unknown.

        Raises:
            JournalError: If the journal cannot be read.
        """
        from sar_compiler.journal.database import JournalFile

        with JournalFile.open_snapshot(place) as file:
            chain = file.chain()
            notes = [] if chain.wrong else [*_uncovered_parts(file)]
        if expected is None and not chain.wrong:
            notes.append(_NOT_KNOWN)
        return cls(place, *_chain_verdict(chain, expected, is_written=file.is_written), chain, tuple(notes))

    @property
    def is_good(self) -> bool:
        """Whether the check has found no problem."""
        return self.state in ("whole", "open")

    def text(self) -> str:
        """Return the result of the check as lines of text."""
        shown = [f"head {self.chain.head}"] if self.chain is not None and self.chain.head else []
        lines = [f"{self.file} {self.words}", *(f"  {line}" for line in (*shown, *self.notes))]
        return "\n".join(map(escape_to_one_line, lines))

    def data(self) -> dict[str, Any]:
        """Return the result of the check as a JSON object."""
        chain = self.chain
        return {
            "file": str(self.file),
            "state": self.state,
            "text": self.words,
            "entries": chain and chain.entries,
            "head": (chain and chain.head) or None,
            "heads": dict(chain.heads if chain is not None else {}),
            "first_wrong": chain and chain.wrong and _wrong_data(chain.wrong),
            "notes": list(self.notes),
        }


def _uncovered_parts(file: "JournalFile") -> "list[str]":
    """Return notes about the parts of a journal that the hash chain does not cover."""
    notes = []
    if count := file.spilled_count():
        events = count_with_noun(count, "event")
        notes.append(f"{events} in the journal's reserve file will be added to the chain by the next run")
    return notes


def _chain_verdict(chain: "JournalChain", expected: str | None, *, is_written: bool) -> tuple[str, str]:
    """Return the state of a hash chain, and a description of this state."""
    has = f"{chain.entries:,} entries in {count_with_noun(chain.runs, 'run')}"
    if chain.wrong is not None:
        why = "This entry was changed, or entries before it were removed, moved or inserted"
        return (
            "altered",
            f"was altered: {_wrong_text(chain.wrong)} does not match the entries before it. {why}",
        )
    if expected is not None and expected != chain.head:
        return "other head", f"has another head: {_other_head(chain, expected)}"
    if chain.is_closed:
        with_head = ", with the given head" if expected else ""
        return "whole", f"is unaltered: {has}, closed by the run's end{with_head}"
    last = (
        "the run is still active" if is_written else "the run crashed" if chain.runs else "no run has started"
    )
    return "open", f"is unaltered so far: {has}, not closed because {last}"


def _other_head(chain: "JournalChain", expected: str) -> str:
    run = next((number for number, each in chain.heads.items() if each == expected), None)
    if run is None:
        return "the chain itself is consistent, so it was truncated or recomputed, or the head belongs to another journal"
    return f"the given head is the head of run {run}, and does not cover later entries"


def _wrong_text(wrong: "ChainEntry") -> str:
    when = day_and_time(wrong.wall) if isinstance(wrong.wall, float) else wrong.wall
    return f"entry {wrong.number} of run {wrong.run}, {wrong.kind}, {when} (mission's clock: {wrong.time}),"


def _wrong_data(wrong: "ChainEntry") -> dict[str, Any]:
    fields = wrong._asdict().items()
    return {
        key: value.hex() if isinstance(value, bytes) else value
        for key, value in fields
        if key not in _OMITTED
    }
