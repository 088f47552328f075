"""What it costs a tick that Groot2 watches the tree. CPU time of the thread that ticks, nobody asking."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import sar_compiler
from benchmarks.figures import Effort, Result, compared, in_turns, often, timed

NONE = "the same with nobody watching"
SIZES = (30, 1_000)
_PORT = 21667


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the figures of ticks, in which every node has changed."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        file = Path(folder, "tree.xml")
        for size in SIZES:
            leaves = "<AlwaysSuccess/>" * effort.size(size)
            tree = f'<BehaviorTree ID="Main"><Sequence>{leaves}</Sequence></BehaviorTree>'
            file.write_text(f'<root BTCPP_format="4">{tree}</root>', encoding="utf-8")
            actions = {
                NONE: _ticks(file, stack, is_watched=False),
                "": _ticks(file, stack, is_watched=True),
            }
            taken = in_turns(actions, effort.rounds)
            yield from compared(f"a tick, {size:,} leaves, watched", taken.pop(""), taken)


def _ticks(file: Path, stack: ExitStack, *, is_watched: bool) -> Callable[[], float]:
    tree = sar_compiler.load(file).compile()
    runner = sar_compiler.TreeRunner(tree)
    if is_watched:
        publisher = sar_compiler.Groot2Publisher(tree, _PORT)
        publisher.watch(runner)
        # Only what a tick does is measured; two of them cannot have one port.
        publisher.close()
        stack.enter_context(closing(publisher))
    return often(lambda count: timed(runner.tick, count))
