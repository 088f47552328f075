"""What a tick costs, and how often the time that it takes to call the leaves' `update` alone; and what it costs with py_trees.

Run it with `make bench`, or `python benchmarks/ticking.py 1000 10000`; `SAR_KERNEL=python` measures the kernel as Python.
All of them tick trees with the same leaves, which do nothing but answer, in turns in one run; each figure is the median
of several runs, in seconds of the processor.
"""

import statistics
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence

from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.runtime import kernel
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.tree.forest import load_forest
from sar_compiler.tree.reading import read_tree_file

SHIPPED = Path(__file__).parents[1] / "trees" / "search_and_rescue.xml"
FAN_OUT = 10
RUNS = 7
RUN_SEC = 0.1
# What the leaves of the shipped tree answer; those that are not named succeed.
SITUATIONS: Mapping[str, Mapping[str, Status]] = {
    "driving to a zone": {"NavigateToZone": Status.RUNNING},
    "reporting": {"NotifyBase": Status.RUNNING},
    "a whole zone in one tick": {},
    "driving home": {"ZonesRemaining?": Status.FAILURE, "NavigateToBase": Status.RUNNING},
}


class Leaf(Behaviour):
    """Answers always the same.

    Args:
        name: Its name.
        answer: What it answers.
    """

    def __init__(self, name: str, answer: Status = Status.SUCCESS) -> None:
        super().__init__(name)
        self._answer = answer

    def update(self) -> Status:
        """Answer."""
        return self._answer


def shipped(answers: Mapping[str, Status]) -> Behaviour:
    """Return the shipped tree with leaves that answer as wanted."""
    root = preview_tree(bind_main(load_forest(SHIPPED, read_tree_file), default_registry())).root
    for node in list(root.iterate()):
        if not node.children and node.parent is not None:
            leaf = Leaf(node.name, answers.get(node.name, Status.SUCCESS))
            leaf.parent = node.parent
            node.parent.children[node.parent.children.index(node)] = leaf
            if hasattr(node.parent, "decorated"):
                node.parent.decorated = leaf
    return root


def balanced(leaves: int) -> Behaviour:
    """Return sequences of sequences with so many leaves, all of which are ticked in every tick."""
    nodes: list[Behaviour] = [Leaf(f"leaf {number}") for number in range(leaves)]
    while len(nodes) > 1:
        nodes = [
            Sequence(f"sequence {start}", memory=True, children=nodes[start : start + FAN_OUT])
            for start in range(0, len(nodes), FAN_OUT)
        ]
    return nodes[0]


def measured(make: Callable[[], Behaviour]) -> tuple[float, float, float]:
    """Return what a tick takes, what it takes with py_trees, and what calling the leaves takes, in seconds."""
    stock, root = make(), make()
    live = LiveTree(root)
    live.tick()
    ticked = [node for node in root.iterate() if not node.children and node.status is not Status.INVALID]

    def call() -> None:
        for leaf in ticked:
            leaf.update()

    ticks: tuple[Callable[[], object], ...] = (live.tick, stock.tick_once, call)
    counts = [max(1, int(RUN_SEC / _timed(tick, 1))) for tick in ticks]
    runs = [[_timed(tick, count) for tick, count in zip(ticks, counts, strict=True)] for _ in range(RUNS)]
    same = [node.status for node in root.iterate()] == [node.status for node in stock.iterate()]
    assert same, "the two do not do the same"
    ours, theirs, alone = (statistics.median(column) for column in zip(*runs, strict=True))
    return ours, theirs, alone


def _timed(tick: Callable[[], object], count: int) -> float:
    start = time.process_time()
    for _ in range(count):
        tick()
    return (time.process_time() - start) / count


def _line(label: str, make: Callable[[], Behaviour]) -> str:
    ours, theirs, alone = measured(make)
    return (
        f"{label:26} {ours * 1e6:10.2f} us {ours / alone:6.1f} {theirs * 1e6:12.2f} us {theirs / ours:6.1f}"
    )


def main() -> None:
    """Measure the shipped tree, and balanced trees of the given sizes."""
    print(f"kernel: {kernel.described()}")
    print(f"{'a tick':26} {'takes':>13} {'x bare':>6} {'py_trees':>15} {'ratio':>6}")
    for label, answers in SITUATIONS.items():
        print(_line(label, lambda answers=answers: shipped(answers)))  # type: ignore[misc]
    for leaves in [int(argument) for argument in sys.argv[1:]] or [1_000, 10_000]:
        print(_line(f"{leaves} leaves", lambda leaves=leaves: balanced(leaves)))  # type: ignore[misc]


if __name__ == "__main__":
    main()
