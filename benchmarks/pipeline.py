"""What reading, checking and compiling a large tree costs, as ratios in one run.

Run it with `make bench`, or `python benchmarks/pipeline.py 1000 10000`. Each figure is the median of several
runs. Read against expat with handlers that do nothing; checked against reading; compiled against the same
tree built by hand-written py_trees constructors.
"""

import gc
import itertools
import re
import statistics
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar
from xml.parsers import expat

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Success
from py_trees.common import Status
from py_trees.composites import Selector, Sequence

from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.register import Registration
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind
from sar_compiler.tree.forest import Forest, load_forest
from sar_compiler.tree.reading import read_tree_file
from sar_compiler.tree.xml import parse_xml

FAN_OUT = 5
RUNS = 5


def written(leaves: int, indent: int = 2) -> str:
    """Return a balanced tree with so many leaves as XML."""
    pad = "  " * indent
    if leaves == 1:
        return f'{pad}<Success name="leaf"/>\n'
    shares = split(leaves)
    tag = ("Sequence", "Selector")[indent % 2]
    inner = "".join(written(share, indent + 1) for share in shares)
    return f'{pad}<{tag} name="control" memory="{str(indent % 2 == 0).lower()}">\n{inner}{pad}</{tag}>\n'


def built(leaves: int, indent: int = 2) -> Behaviour:
    """Build the same tree by hand."""
    if leaves == 1:
        return Success("leaf")
    cls = (Sequence, Selector)[indent % 2]
    children = [built(share, indent + 1) for share in split(leaves)]
    return cls(name="control", memory=indent % 2 == 0, children=children)


def split(leaves: int) -> list[int]:
    """Share leaves out to as many children as fit."""
    children = min(FAN_OUT, leaves)
    return [leaves // children + (index < leaves % children) for index in range(children)]


def seconds(action: Callable[[], object], runs: int = RUNS) -> float:
    """Return the median time of an action."""
    times = []
    for _ in range(runs):
        gc.collect()
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def peak(action: Callable[[], object]) -> int:
    """Return the most memory that an action holds at a time, in bytes."""
    gc.collect()
    tracemalloc.start()
    kept = action()
    size = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    del kept
    return size


def scan(data: bytes) -> None:
    """Parse with handlers that do nothing."""
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda *_: None
    parser.EndElementHandler = lambda *_: None
    parser.Parse(data, True)  # noqa: FBT003


def measure(leaves: int) -> None:
    """Print the figures for one size."""
    data = f'<root BTCPP_format="4">\n<BehaviorTree ID="A">\n{written(leaves)}</BehaviorTree></root>'.encode()
    registry = default_registry()
    tree = parse_xml(data)
    forest = Forest.of(tree)
    binding = bind_main(forest, registry)
    scanning = seconds(lambda: scan(data))
    reading = seconds(lambda: parse_xml(data))
    checking = seconds(lambda: check(forest, registry))
    binding_time = seconds(lambda: bind_main(forest, registry))
    compiling = seconds(lambda: preview_tree(binding))
    building = seconds(lambda: built(leaves))
    memory = peak(lambda: preview_tree(bind_main(Forest.of(parse_xml(data)), registry))) / peak(
        lambda: built(leaves)
    )
    print(f"{leaves} leaves, {len(data) / 1e6:.2f} MB")
    print(f"  read     {reading * 1e3:8.1f} ms  {reading / scanning:5.2f} x expat with empty handlers")
    print(f"  check    {checking * 1e3:8.1f} ms  {checking / reading:5.2f} x read")
    print(f"  bind     {binding_time * 1e3:8.1f} ms  {binding_time / reading:5.2f} x read")
    print(
        f"  compile  {compiling * 1e3:8.1f} ms  {compiling / building:5.2f} x py_trees constructors by hand"
    )
    print(f"  memory   {memory:5.2f} x the tree built by hand (peak, from file to tree)")


def against_the_parser_of_py_trees(leaves: int) -> None:
    """Compare with py_trees' own XML parser (from 2.5 on), on a tree that both can read."""
    try:
        from py_trees.parsers.behaviour_tree_xml import parse_behaviour_tree_xml
        from py_trees.ports import BehaviourWithPorts
    except ImportError:
        print("this py_trees has no XML parser")
        return

    class Leaf(BehaviourWithPorts):
        INPUT_PORTS: ClassVar[dict[str, object]] = {}
        OUTPUT_PORTS: ClassVar[dict[str, object]] = {}

        def update(self) -> Status:
            return Status.SUCCESS

    registry = Registry([*default_registry().registrations(), Registration("Leaf", Success, Kind.ACTION)])
    number = itertools.count()
    # Their parser wants every name to be another one.
    text = re.sub(r'name="', lambda _: f'name="n{next(number)}', written(leaves).replace("<Success", "<Leaf"))
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as file:
        file.write(f'<root>\n<BehaviorTree ID="A">\n{text}</BehaviorTree></root>')
        file.flush()
        theirs = seconds(lambda: parse_behaviour_tree_xml(file.name, "A", {"Leaf": Leaf}), runs=1)

        def compiled(*, checked: bool) -> None:
            forest = load_forest(Path(file.name), read_tree_file)
            assert not checked or not check(forest, registry)
            preview_tree(bind_main(forest, registry))

        ours = seconds(lambda: compiled(checked=False))
        with_checks = seconds(lambda: compiled(checked=True))
    print(
        f"{leaves} leaves, from file to tree: {ours * 1e3:.0f} ms, with all checks {with_checks * 1e3:.0f} ms"
    )
    print(
        f"  py_trees' own parser: {theirs:.2f} s, {theirs / ours:.1f} and {theirs / with_checks:.1f} times as long"
    )


def main() -> None:
    """Measure the sizes named on the command line."""
    sizes = [int(text) for text in sys.argv[1:]] or [100, 1_000, 10_000, 100_000]
    for size in sizes:
        measure(size)
    against_the_parser_of_py_trees(min(10_000, max(sizes)))


if __name__ == "__main__":
    main()
