"""What a journal costs: a fact, which waits for the disk, each tick, whose statuses are watched, and a check of its chain.

Ticks are CPU time. A fact is time that passes: it takes what the disk of the temporary folder takes.
"""

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from unittest import mock

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence

from benchmarks.figures import LOOP, Effort, Result, compared, in_turns, loop, often, timed
from benchmarks.leaves import Leaf
from benchmarks.trees import FAN_OUT
from sar_compiler.journal import database
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import Row
from sar_compiler.journal.opening import open_journal
from sar_compiler.journal.status_watch import StatusWatch
from sar_compiler.ros.runner import TreeRunner

NONE = "the same without a journal"
UNCHAINED = "the same without a chain"
FACT = "a fact, time that passes"
ONE_RUNS = "a tick, 1,000 leaves, one runs and no node changes"
SIZES = (30, 1_000)
_FACTS = 200
# A disk takes now more, now less.
_FACT_ROUNDS = 5
_ENTRIES, _BATCH = 1_000_000, 1_000


class Changing(Behaviour):
    """A leaf that answers otherwise in every tick."""

    def update(self) -> Status:
        """Answer SUCCESS, with another message than before."""
        self.feedback_message = "2.50 m left" if self.feedback_message == "2.51 m left" else "2.51 m left"
        return Status.SUCCESS


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the figures of facts and of ticks."""
    with tempfile.TemporaryDirectory() as folder:
        journal = open_journal(Path(folder, "mission.journal"))
        journal.begin({}, {})
        facts = {"": lambda: _facts(journal), UNCHAINED: lambda: _unchained_facts(journal), LOOP: loop}
        taken = in_turns(facts, _FACT_ROUNDS * effort.rounds)
        yield from compared(FACT, taken.pop(""), taken)
        for kind, leaf in (("no node changes", Leaf), ("every leaf changes", Changing)):
            for size in SIZES:
                actions = {
                    NONE: _ticks(leaf, effort.size(size), None),
                    "": _ticks(leaf, effort.size(size), journal),
                }
                taken = in_turns(actions, effort.rounds)
                yield from compared(f"a tick, {size:,} leaves, {kind}", taken.pop(""), taken)
        running = {each: _ticks_of(_one_running(effort.size(1_000)), each) for each in (None, journal)}
        taken = in_turns({NONE: running[None], "": running[journal]}, effort.rounds)
        yield from compared(ONE_RUNS, taken.pop(""), taken)
        journal.close()
        place, count = Path(folder, "long.journal"), effort.size(_ENTRIES)
        _write(place, count)
        taken = in_turns({"": lambda: timed(lambda: _check(place), 1), LOOP: loop}, effort.rounds)
        yield from compared(f"a check of {count:,} entries", taken.pop(""), taken)


def _write(place: Path, count: int) -> None:
    """Write a journal with so many entries."""
    with closing(JournalFile.create(place)) as file:
        file.reserve()
        file.begin_run({}, {}, 0.0)
        data = '{"node": 17, "tick": 1000, "status": "RUNNING", "message": "2.51 m left", "label": ""}'
        for start in range(0, count, _BATCH):
            file.write(
                Row(number, 1, float(start), float(start), "status", data)
                for number in range(start + 1, min(start + _BATCH, count) + 1)
            )


def _check(place: Path) -> None:
    with closing(JournalFile.read(place)) as file, file.snapshot():
        assert file.chain().wrong is None


def _facts(journal: Journal) -> float:
    start = time.perf_counter()
    for number in range(_FACTS):
        journal.note("zone_searched", zone=f"zone_{number}", survivor=(-2.5, 3.2))
    return (time.perf_counter() - start) / _FACTS


def _unchained_facts(journal: Journal) -> float:
    with mock.patch.object(database, "linked", _no_link):
        return _facts(journal)


def _no_link(*_: object) -> bytes:
    return b""


def _one_running(size: int) -> Behaviour:
    """Return a tree whose last leaf runs on, with all before it done."""
    level: list[Behaviour] = [Leaf(f"leaf {number}") for number in range(size - 1)]
    level.append(Leaf("the last", Status.RUNNING))
    while len(level) > 1:
        groups = (level[start : start + FAN_OUT] for start in range(0, len(level), FAN_OUT))
        level = [Sequence("group", memory=True, children=group) for group in groups]
    return level[0]


def _ticks(leaf: type[Behaviour], size: int, journal: Journal | None) -> Callable[[], float]:
    leaves: list[Behaviour] = [leaf(f"leaf {number}") for number in range(size)]
    return _ticks_of(Sequence("root", memory=False, children=leaves), journal)


def _ticks_of(root: Behaviour, journal: Journal | None) -> Callable[[], float]:
    runner = TreeRunner(root)
    if journal is not None:
        runner.add_visitor(StatusWatch(root, journal))
    return often(lambda count: timed(runner.tick, count))
