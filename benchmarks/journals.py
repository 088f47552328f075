"""The cost of reading a journal of a million entries: a run of a patrol, recorded as `sar-run` records one."""

import itertools
import random
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from benchmarks.commands import SCRIPTS, run
from benchmarks.figures import Effort, medians
from benchmarks.rows import Benchmark, Limit, Measured, Row, seconds
from benchmarks.trees import around, described, sequence
from sar_compiler.analysis.tree_analysis import stage_of
from sar_compiler.compiler.outline import outline
from sar_compiler.journal.journal_entries import Ending
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.journal.status_watch import StatusWatch
from sar_compiler.loaded_tree import load
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.live import LiveTree, show_visits
from sar_compiler.runtime.kernel.tree_nodes import Visit
from sar_compiler.views.drawing import drawn_nodes

_ENTRIES = 1_000_000
_PERIOD_SEC, _TICKS_A_FACT = 0.1, 500
_LIMITS = (Limit(5.0, "s CPU"), Limit(150.0, "MB"))
# A measurement that takes longer is made only once, because it misses its goal by far.
_LONG_SEC = 15.0
_RUNS, _FAILS = 0.4, 0.05


def _patrol() -> str:
    """Return a patrol that visits four points, with fallbacks, until its last leaf fails."""

    def visit(point: int) -> str:
        drive = around("Fallback", [f'<Try name="Drive{point}"/>', f'<Try name="Detour{point}"/>'])
        photo = around('RetryUntilSuccessful num_attempts="3"', [f'<Try name="Photo{point}"/>'])
        return around("ForceSuccess", [sequence([f'<Check name="Free{point}"/>', drive, photo])])

    rounds = sequence([*map(visit, range(4)), '<Check name="BatterySuffices"/>'])
    return described(around("KeepRunningUntilFailure", [rounds]))


class _Outcomes:
    """Chooses the outcomes of leaves at random: most run for a while and succeed; the battery is checked last."""

    def __init__(self) -> None:
        self._chance = random.Random(1)  # noqa: S311 - the same journal in every run
        self.is_over = False

    def choose(self, leaf: Any, options: Sequence[Any]) -> Any:
        """Return an outcome of a leaf."""
        wanted = self._status(leaf.name)
        return next(each for each in options if each.status == wanted)

    def _status(self, name: str) -> str:
        if name == "BatterySuffices":
            return "FAILURE" if self.is_over else "SUCCESS"
        drawn = self._chance.random()
        if drawn < _RUNS and not name.startswith("Free"):
            return "RUNNING"
        return "FAILURE" if drawn > 1.0 - _FAILS else "SUCCESS"


def write_journal(folder: Path, entries: int) -> tuple[Path, Path]:
    """Record a patrol with at least a number of entries; return the paths of the tree and of the journal."""
    tree, path = folder / "patrol.xml", folder / "patrol.journal"
    tree.write_text(_patrol(), encoding="utf-8")
    loaded = load(tree)
    simulated, compiled = stage_of(loaded).play().simulated, loaded.preview()
    simulated.policy = outcomes = _Outcomes()
    live = LiveTree(simulated.root, is_strict=True)
    written = 0

    def count(_entry: object) -> None:
        nonlocal written
        written += 1

    with closing(open_journal(path)) as journal:
        journal.add_listener(count)
        journal.clock = simulated.clock
        looks = [[each.shape.value, each.sign] for each in drawn_nodes(compiled)]
        about = {"looks": looks, "tree_file": str(tree), "tree_id": "Main"}
        journal.begin({"tree": outline(compiled)}, about)
        watch = StatusWatch(simulated.root, journal)
        for tick in itertools.count(1):
            outcomes.is_over = written >= entries
            if _tick(live, watch) != "RUNNING":
                break
            simulated.clock.advance(_PERIOD_SEC)
            if tick % _TICKS_A_FACT == 0:
                # A fact is written at once, with all that waits: a robot never has so many entries in a second.
                journal.record_event("photo_taken", point=f"point {tick}")
        journal.end_run(Ending.OVER, 1)
    return tree, path


def _tick(live: LiveTree, watch: StatusWatch) -> str:
    visits: list[Visit] = []
    watch.initialise()
    status = WORDS[live.tick_and_visit(visits)]
    for behaviour in show_visits(visits):
        watch.run(behaviour)
    watch.finalise()
    return status


class Stage:
    """A folder with a journal.

    Args:
        tree: The tree of the run.
        journal: The journal.
    """

    def __init__(self, tree: Path, journal: Path) -> None:
        self.tree, self.journal = tree, journal


@contextmanager
def set_up(effort: Effort) -> Iterator[Stage]:
    """Write the journal."""
    with tempfile.TemporaryDirectory() as folder:
        yield Stage(*write_journal(Path(folder), effort.size(_ENTRIES)))


def _read_by(command: Callable[[Stage], Sequence[str | Path]]) -> Callable[[Stage, Effort], Measured]:
    def measure(stage: Stage, _effort: Effort) -> Measured:
        name, *words = command(stage)
        first = run([SCRIPTS / name, *words], statuses=(0, 1))
        if first.cpu > _LONG_SEC:
            return Measured(
                first[1:3], f"{seconds(first.passed)} passing; measured once, because it is so long"
            )
        taken = iter([first[:3]])
        passed, cpu, memory = medians(
            lambda: next(taken, None) or run([SCRIPTS / name, *words], statuses=(0, 1))[:3], 2
        )
        return Measured((cpu, memory), f"{seconds(passed)} passing")

    return measure


def _row(name: str) -> Row:
    def command(stage: Stage) -> Sequence[str | Path]:
        output = [f"--output={stage.tree.with_name('report.html')}"] if name == "report" else []
        return ["sar-journal", name, *output, stage.journal]

    measure = _read_by(command)
    return Row(
        f"`sar-journal {name}` of {_ENTRIES:,} entries",
        _LIMITS,
        "CPU time and peak memory of a process",
        measure,
    )


BENCHMARK = Benchmark(
    (
        *map(_row, ("why", "stats", "report", "show")),
        Row(
            f"`conform` of {_ENTRIES:,} entries",
            _LIMITS,
            "the same",
            _read_by(lambda stage: ("sar-compile", "conform", stage.tree, stage.journal)),
        ),
    ),
    set_up,
)
