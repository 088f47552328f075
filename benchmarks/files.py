"""The cost of the commands that read files: start-up, one file, a folder, and files of 10,000 nodes."""

import itertools
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.commands import PLAIN, Cost, plain, run
from benchmarks.figures import Effort, compared, medians
from benchmarks.rows import Benchmark, Limit, Measured, Row, seconds
from benchmarks.trees import around, balanced, document, in_turn, mission

_LXML = "x `import lxml.etree`"
_NODES, _FILES = 10_000, 300
# A check is kept only if all modules that it imports were written longer ago than this, in seconds.
_RECENT_SEC = 31.0
_SCRIPT = document('<Sequence><Script code="rounds := 1"/><ScriptCondition code="rounds == 1"/></Sequence>')
_LARGE = in_turn(
    '<AlwaysSuccess name="n{0}"/>',
    '<Sleep name="s{0}" msec="{0}"/>',
    '<Script name="w{0}" code="k{0} := 1"/>',
    '<ScriptCondition name="r{0}" code="k{0} == 1"/>',
)


class Stage:
    """A folder with the files that the rows need.

    Args:
        folder: The folder; also the working folder of the commands.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._caches = itertools.count()
        self.cache = folder / "cache"
        (folder / "script.xml").write_text(_SCRIPT, encoding="utf-8")

    def new_cache(self) -> None:
        """Use a new cache, so that commands do not find results of earlier ones."""
        self.cache = self.folder / f"cache {next(self._caches)}"

    def compile(self, *words: str, statuses: tuple[int, ...] = (0,)) -> Cost:
        """Run `sar-compile`."""
        return self.run("sar-compile", *words, statuses=statuses)

    def run(self, name: str, *words: str, statuses: tuple[int, ...] = (0,)) -> Cost:
        """Run a command of the environment without ROS."""
        more = {"XDG_CACHE_HOME": str(self.cache)}
        return run([plain(name), *words], statuses=statuses, more=more, folder=self.folder)

    def large(self, name: str, nodes: int, *, is_changed: bool = False) -> str:
        """Write a file with a number of nodes if it does not exist; a changed file differs in 1 of 25 nodes."""
        path = self.folder / f"{name}_{nodes}.xml"
        if not path.exists():
            leaves = _LARGE(nodes)
            if is_changed:
                leaves[::100] = [each.replace("/>", ' _onSuccess="done := 1"/>') for each in leaves[::100]]
                leaves[25::100] = [around("Inverter", [each]) for each in leaves[25::100]]
                leaves[50::100] = [each + '<AlwaysSuccess name="new"/>' for each in leaves[50::100]]
                del leaves[75::100]
            path.write_text(document(balanced(leaves)), encoding="utf-8")
        return path.name


@contextmanager
def set_up(_effort: Effort) -> Iterator[Stage]:
    """Set up a folder.

    Raises:
        UnmeasurableError: The environment without ROS is missing.
    """
    plain("sar-compile")
    with tempfile.TemporaryDirectory() as folder:
        yield Stage(Path(folder))


def _validate(stage: Stage, effort: Effort, file: str) -> Measured:
    """Return the ratio of a validation to an import of lxml."""

    def once() -> tuple[float, float]:
        stage.new_cache()
        validated = stage.compile("validate", file)
        return validated.cpu, stage.run("python", "-c", "import lxml.etree").cpu

    once()
    found = compared(once, effort.rounds)
    return Measured((found.ratio,), f"{seconds(found.ours)}, the import {seconds(found.theirs)}")


def _short(stage: Stage, effort: Effort) -> Measured:
    """Return the CPU time of the slowest command that reads no tree."""
    commands = {
        "--help": ("sar-compile", "--help"),
        "--version": ("sar-compile", "--version"),
        "a missing file": ("sar-compile", "validate", "none.xml"),
        "sar-run --help": ("sar-run", "--help"),
        "sar-run and a missing file": ("sar-run", "none.xml"),
    }

    def once() -> list[float]:
        return [stage.run(*words, statuses=(0, 1, 2)).cpu for words in commands.values()]

    once()
    taken = medians(once, effort.rounds)
    note = ", ".join(f"{name} {seconds(each)}" for name, each in zip(commands, taken, strict=True))
    return Measured((max(taken),), note)


def _show(stage: Stage, effort: Effort) -> Measured:
    return Measured(medians(lambda: (stage.compile("show", "search_and_rescue").cpu,), effort.rounds))


def _folder(stage: Stage, effort: Effort) -> str:
    """Write a folder of trees, of which every second one has scripts; return its name."""
    folder = stage.folder / "trees"
    if not folder.exists():
        folder.mkdir()
        for at in range(effort.size(_FILES)):
            text = mission(at, f"Mission{at}", has_scripts=at % 2 == 0)
            (folder / f"mission_{at}.xml").write_text(text, encoding="utf-8")
    return folder.name


def _cold(stage: Stage, effort: Effort) -> Measured:
    """Return the elapsed time for a folder with an empty cache."""
    folder = _folder(stage, effort)

    def once() -> tuple[float, float]:
        stage.new_cache()
        cost = stage.compile("validate", folder)
        return cost.passed, cost.cpu

    passed, cpu = medians(once, effort.few)
    return Measured((passed,), f"{seconds(cpu)} CPU")


def _again(stage: Stage, effort: Effort) -> Measured:
    """Return the elapsed time for a folder that was validated before and has not changed."""
    folder = _folder(stage, effort)
    installed = (PLAIN.parent / ".installed").stat().st_mtime
    time.sleep(max(0.0, installed + _RECENT_SEC - time.time()))
    stage.compile("validate", folder)
    passed, cpu = medians(lambda: stage.compile("validate", folder)[:2], effort.few)
    return Measured((passed,), f"{seconds(cpu)} CPU")


def _diff(stage: Stage, effort: Effort) -> Measured:
    """Return the CPU time of a diff, and its ratio to one of half the size."""

    def once() -> tuple[float, float]:
        return tuple(  # type: ignore[return-value]
            stage.compile(
                "diff", stage.large("old", nodes), stage.large("new", nodes, is_changed=True), statuses=(0, 1)
            ).cpu
            for nodes in (effort.size(_NODES), effort.size(_NODES // 2))
        )

    once()
    found = compared(once, effort.few)
    return Measured((found.ours, found.ratio))


def _of_large(*words: str, statuses: tuple[int, ...] = (0,)) -> Callable[[Stage, Effort], Measured]:
    """Return a function that measures the CPU time of a command with a large file."""

    def measure(stage: Stage, effort: Effort) -> Measured:
        file = stage.large("old", effort.size(_NODES))
        (cpu,) = medians(lambda: (stage.compile(*words, file, statuses=statuses).cpu,), effort.few)
        return Measured((cpu,))

    return measure


_SIZE = f"{_NODES:,} nodes"

BENCHMARK = Benchmark(
    (
        Row(
            "start-up of help, version and a missing file: the slowest",
            (Limit(0.07, "s CPU"),),
            "CPU time of the process, without ROS",
            _short,
        ),
        Row(
            "`sar-compile show` of the shipped tree",
            (Limit(0.2, "s CPU"),),
            "the same",
            _show,
        ),
        Row(
            "`validate` of the shipped tree",
            (Limit(3.0, _LXML),),
            "CPU time, compared with an import; an empty cache",
            lambda stage, effort: _validate(stage, effort, "search_and_rescue"),
        ),
        Row(
            "`validate` of a file with scripts",
            (Limit(3.0, _LXML),),
            "the same",
            lambda stage, effort: _validate(stage, effort, "script.xml"),
        ),
        Row(
            f"`validate` of a folder of {_FILES} files, cold",
            (Limit(2.5, "s passing"),),
            "an empty cache; files of 20 to 60 nodes, half of them with scripts",
            _cold,
        ),
        Row(
            f"`validate` of a folder of {_FILES} files, again",
            (Limit(0.4, "s passing"),),
            "the same files, unchanged",
            _again,
        ),
        Row(
            f"`diff` of two files of {_SIZE}",
            (Limit(2.0, "s CPU"), Limit(2.3, "x half the nodes")),
            "1 of 25 elements is changed, wrapped, added or removed",
            _diff,
        ),
        Row(f"`show` of {_SIZE}", (Limit(2.0, "s CPU"),), "CPU time", _of_large("show")),
        Row(
            f"`format` of {_SIZE}",
            (Limit(2.0, "s CPU"),),
            "CPU time, `--check`",
            _of_large("format", "--check", statuses=(0, 1)),
        ),
    ),
    set_up,
)
