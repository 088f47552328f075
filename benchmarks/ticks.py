"""The cost of a tick compared with BehaviorTree.CPP in C++: trees of usual sizes, and the slowest constructs.

Both engines tick the tree of the same file. `Leaf` succeeds. Its `update` is in Python in this project, like the leaves of users, and in C++ in
BehaviorTree.CPP.
"""

import statistics
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from benchmarks import driver, trees
from benchmarks.figures import Effort, UnmeasurableError, compared_calls, enough_calls, medians, timed
from benchmarks.rows import Benchmark, Limit, Measured, Row, seconds
from sar_compiler.compiler import bind_main, compile_tree
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml

_CPP = "x BehaviorTree.CPP"
_COUNT = 100
_USUAL: Mapping[str, str] = {
    "Nav2's shape with 12 leaves": trees.navigation(6),
    "Nav2's shape with 30 leaves": trees.navigation(24),
    "mixed, 30": trees.mixed(30),
    "mixed, 100": trees.mixed(100),
    "mixed, 1,000": trees.mixed(1000),
    "one of 1,000 runs": trees.one_running(1000),
}


class Leaf(Behaviour):
    """A leaf that succeeds."""

    def update(self) -> Status:
        """Succeed."""
        return Status.SUCCESS


class Stage:
    """The driver, and a folder for the files of trees.

    Args:
        folder: The folder.
        cpp: The driver; None if it is not built.
    """

    def __init__(self, folder: Path, cpp: driver.Driver | None) -> None:
        self._path = folder / "tree.xml"
        self._cpp = cpp
        self._registry = Registry([*default_registry().specs(), NodeSpec("Leaf", Leaf, Kind.ACTION)])

    def compare(self, bodies: Mapping[str, str], rounds: int) -> dict[str, tuple[float, float]]:
        """Return the ratio of a tick to one of BehaviorTree.CPP, and its seconds, for each tree.

        Raises:
            UnmeasurableError: The driver is not built, or a measurement is refused.
        """
        if self._cpp is None:
            taken = ", ".join(f"{name} {seconds(self._ours(body, rounds))}" for name, body in bodies.items())
            raise UnmeasurableError(f"no ratio, {driver.VARIABLE} names no driver; a tick takes: {taken}")
        found = {}
        for name, body in bodies.items():
            live = self._live(body)
            self._cpp.load(self._path)
            result = compared_calls(lambda count: timed(live.tick, count), self._cpp.tick, rounds)  # noqa: B023
            found[name] = result.ratio, result.ours
        return found

    def _ours(self, body: str, rounds: int) -> float:
        live = self._live(body)
        count = enough_calls(lambda count: timed(live.tick, count))
        (taken,) = medians(lambda: (timed(live.tick, count),), rounds)
        return taken

    def _live(self, body: str) -> LiveTree:
        self._path.write_text(trees.document(body), encoding="utf-8")
        binding = bind_main(Forest.from_file(parse_xml(self._path.read_bytes())), self._registry)
        return LiveTree(compile_tree(binding, {}, {}).root)


def describe_driver() -> str:
    """Return the name of the driver for the conditions of a run."""
    path = driver.driver_path()
    return f"by the C++ driver {path.name}" if path is not None else "the driver is not built"


@contextmanager
def set_up(_effort: Effort) -> Iterator[Stage]:
    """Start the driver, if it is built."""
    with tempfile.TemporaryDirectory() as folder, driver.running() as cpp:
        yield Stage(Path(folder), cpp)


def _usual(stage: Stage, effort: Effort) -> Measured:
    found = stage.compare(_USUAL, effort.rounds)
    note = ", ".join(f"{name} {ratio:.2f} x {seconds(own)}" for name, (ratio, own) in found.items())
    return Measured((statistics.median(ratio for ratio, _ in found.values()),), note)


def _constructs(stage: Stage, effort: Effort) -> Measured:
    bodies = {name: trees.of_constructs(body, _COUNT) for name, body in trees.CONSTRUCTS.items()}
    found = stage.compare(bodies, effort.rounds)
    note = ", ".join(f"{name} {ratio:.2f}" for name, (ratio, _) in found.items())
    return Measured((max(ratio for ratio, _ in found.values()),), note)


BENCHMARK = Benchmark(
    (
        Row(
            "a tick of six trees of usual shapes and sizes, the median",
            (Limit(2.5, _CPP),),
            "equal numbers of ticks; leaves in Python compared with leaves in C++",
            _usual,
        ),
        Row(
            "the slowest of five constructs",
            (Limit(4.0, _CPP),),
            f"the same; a tree with {_COUNT} of each, all of which are executed in each tick",
            _constructs,
        ),
    ),
    set_up,
)
