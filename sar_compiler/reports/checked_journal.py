"""Check with its chain that a journal was not altered."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.journal.journal_entries import day_and_time
from sar_compiler.tree.display_text import escape_to_one_line
from sar_compiler.tree.plain import count_with_noun

if TYPE_CHECKING:
    from sar_compiler.journal.chain import ChainEntry, JournalChain
    from sar_compiler.journal.database import JournalFile

_NOT_KNOWN = (
    "Without --head HEX, from the summary or a report, a recomputed or truncated chain cannot be detected"
)
_UNTOLD = ("what", "data", "link")


class CheckedJournal(NamedTuple):
    """The result of checking a journal.

    Attributes:
        file: Its path.
        state: `whole`, `open` (whole, and without an end), `altered` or `other head`.
        words: The state in words.
        chain: The result for its chain; None if there is none.
        notes: The limits of the check, in sentences.
    """

    file: Path
    state: str
    words: str
    chain: "JournalChain | None" = None
    notes: tuple[str, ...] = ()

    @classmethod
    def check(cls, place: Path, expected: str | None) -> "CheckedJournal":
        """Check a journal, and return the result.

        Args:
            place: Where it is.
            expected: The required head; None if unknown.

        Raises:
            JournalError: If it cannot be read.
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
        """Whether no problem was found."""
        return self.state in ("whole", "open")

    def text(self) -> str:
        """Return the result in words."""
        shown = [f"head {self.chain.head}"] if self.chain is not None and self.chain.head else []
        lines = [f"{self.file} {self.words}", *(f"  {line}" for line in (*shown, *self.notes))]
        return "\n".join(map(escape_to_one_line, lines))

    def data(self) -> dict[str, Any]:
        """Return the result as JSON values."""
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
    """Return notes on the parts of a journal that the chain does not cover."""
    notes = []
    if count := file.spilled_count():
        notes.append(
            f"{count_with_noun(count, 'fact')} beside it, in its reserve, will be chained by the next run"
        )
    return notes


def _chain_verdict(chain: "JournalChain", expected: str | None, *, is_written: bool) -> tuple[str, str]:
    """Return the state of a chain, with its description."""
    has = f"{chain.entries:,} entries in {count_with_noun(chain.runs, 'run')}"
    if chain.wrong is not None:
        why = "it was changed, or entries before it were removed, moved or inserted"
        return (
            "altered",
            f"was altered: {_wrong_text(chain.wrong)} does not match the entries before it: {why}",
        )
    if expected is not None and expected != chain.head:
        return "other head", f"has another head: {_other_head(chain, expected)}"
    if chain.is_closed:
        with_head = ", with the head that was given" if expected else ""
        return "whole", f"is unaltered: {has}, closed by the run's end{with_head}"
    last = "the run is still active" if is_written else "the run crashed" if chain.runs else "none has begun"
    return "open", f"is unaltered so far: {has}, and not closed: {last}"


def _other_head(chain: "JournalChain", expected: str) -> str:
    run = next((number for number, each in chain.heads.items() if each == expected), None)
    if run is None:
        return "it is consistent, so it was truncated or recomputed, or the head belongs to another journal"
    return f"the given head is that of run {run}, and does not cover later entries"


def _wrong_text(wrong: "ChainEntry") -> str:
    when = day_and_time(wrong.wall) if isinstance(wrong.wall, float) else wrong.wall
    return f"entry {wrong.number} of run {wrong.run}, {wrong.kind}, {when} (mission's clock: {wrong.time}),"


def _wrong_data(wrong: "ChainEntry") -> dict[str, Any]:
    told = wrong._asdict().items()
    return {
        key: value.hex() if isinstance(value, bytes) else value for key, value in told if key not in _UNTOLD
    }
