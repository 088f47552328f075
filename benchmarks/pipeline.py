"""What reading, checking and compiling a large tree costs, as ratios in one run.

Run it with `make bench`, or `python benchmarks/pipeline.py 1000 10000`. Each figure is the median of several
runs; what is compared runs in turn, so that both have the same share of a busy machine. The tree is balanced, five
nodes in each.

Reading is compared with expat and handlers that do nothing, checking and binding with reading, and compiling with
the same tree built by hand-written py_trees constructors, during which the garbage collector pauses as it does
while a tree is compiled. For py_trees' own XML parser there is a file that both can read, and each way from the file
to the tree runs in a process of its own.
"""

import gc
import itertools
import multiprocessing
import statistics
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path
from typing import ClassVar
from xml.parsers import expat

from port_leaves import Leaf, Reader, Writer
from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.tree.forest import Forest, load_forest
from sar_compiler.tree.gc_pause import gc_paused
from sar_compiler.tree.reading import read_tree_file
from sar_compiler.tree.xml import parse_xml

FAN_OUT = 5
RUNS = 7


def registry_with_leaves() -> Registry:
    """Return the registry, with these leaves in it."""
    leaves = [NodeSpec(cls.__name__, cls, Kind.ACTION) for cls in (Leaf, Reader, Writer)]
    return Registry([*default_registry().specs(), *leaves])


def written(leaves: int) -> str:
    """Return a balanced tree with so many leaves as XML; every name is another one."""
    text = _written(leaves, 2, itertools.count())
    return f'<root BTCPP_format="4">\n<BehaviorTree ID="A">\n{text}</BehaviorTree></root>'


def _written(leaves: int, indent: int, number: Iterator[int]) -> str:
    pad, name = "  " * indent, f"node{next(number)}"
    if leaves == 1:
        return f'{pad}<Leaf name="{name}"/>\n'
    tag = ("Sequence", "Selector")[indent % 2]
    inner = "".join(_written(share, indent + 1, number) for share in split(leaves))
    return f'{pad}<{tag} name="{name}" memory="{str(indent % 2 == 0).lower()}">\n{inner}{pad}</{tag}>\n'


def built(leaves: int, names: Sequence[str]) -> Behaviour:
    """Build the same tree by hand, with the garbage collector paused."""
    with gc_paused():
        return _built(leaves, 2, iter(names))


def _built(leaves: int, indent: int, names: Iterator[str]) -> Behaviour:
    name = next(names)
    if leaves == 1:
        return Leaf(name)
    cls = (composites.Sequence, composites.Selector)[indent % 2]
    children = [_built(share, indent + 1, names) for share in split(leaves)]
    return cls(name=name, memory=indent % 2 == 0, children=children)


def split(leaves: int) -> list[int]:
    """Share leaves out to as many children as fit."""
    children = min(FAN_OUT, leaves)
    return [leaves // children + (index < leaves % children) for index in range(children)]


def seconds(*actions: Callable[[], object], runs: int = RUNS) -> list[float]:
    """Return the median time of each action; they run in turn."""
    times: list[list[float]] = [[] for _ in actions]
    for _ in range(runs):
        for action, taken in zip(actions, times, strict=True):
            gc.collect()
            start = time.perf_counter()
            made = action()
            taken.append(time.perf_counter() - start)
            del made
    return [statistics.median(taken) for taken in times]


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
    data = written(leaves).encode()
    registry = registry_with_leaves()
    tree = parse_xml(data)
    forest = Forest.of(tree)
    binding = bind_main(forest, registry)
    names = [bound.name for bound in binding.nodes()]
    scanning, reading, checking, binding_time, compiling, building = seconds(
        lambda: scan(data),
        lambda: parse_xml(data),
        lambda: check(forest, registry),
        lambda: bind_main(forest, registry),
        lambda: preview_tree(binding),
        lambda: built(leaves, names),
    )
    memory = peak(lambda: preview_tree(bind_main(Forest.of(parse_xml(data)), registry))) / peak(
        lambda: built(leaves, names)
    )
    print(f"{leaves} leaves, {len(data) / 1e6:.2f} MB")
    print(f"  read     {reading * 1e3:8.1f} ms  {reading / scanning:5.2f} x expat with empty handlers")
    print(f"  check    {checking * 1e3:8.1f} ms  {checking / reading:5.2f} x read")
    print(f"  bind     {binding_time * 1e3:8.1f} ms  {binding_time / reading:5.2f} x read")
    print(
        f"  compile  {compiling * 1e3:8.1f} ms  {compiling / building:5.2f} x py_trees constructors by hand"
    )
    print(f"  memory   {memory:5.2f} x the tree built by hand (peak, from file to tree)")


def ours(path: str, *, checked: bool) -> float:
    """Return the median time from a file to the tree."""
    registry = registry_with_leaves()

    def compiled() -> object:
        forest = load_forest(Path(path), read_tree_file)
        findings = check(forest, registry) if checked else []
        assert not findings
        return preview_tree(bind_main(forest, registry))

    return seconds(compiled)[0]


def theirs(path: str, *, paused: bool) -> float:
    """Return the median time of py_trees' own parser, with the garbage collector as it is or paused."""
    from py_trees.parsers.behaviour_tree_xml import parse_behaviour_tree_xml
    from py_trees.ports import BehaviourWithPorts, PortInformation

    class WithoutPorts(BehaviourWithPorts):
        INPUT_PORTS: ClassVar[dict[str, object]] = {}
        OUTPUT_PORTS: ClassVar[dict[str, object]] = {}

        def update(self) -> Status:
            return Status.SUCCESS

    class WithInput(WithoutPorts):
        INPUT_PORTS: ClassVar[dict[str, object]] = {"x": PortInformation(data_type=str)}

    class WithOutput(WithoutPorts):
        OUTPUT_PORTS: ClassVar[dict[str, object]] = {"y": PortInformation(data_type=str)}

    classes = {"Leaf": WithoutPorts, "Reader": WithInput, "Writer": WithOutput}

    def parsed() -> object:
        with gc_paused() if paused else nullcontext():
            return parse_behaviour_tree_xml(path, "A", classes)

    return seconds(parsed, runs=3)[0]


def alone(measured: Callable[..., float], path: str, **how: bool) -> float:
    """Measure in a process of its own: what one leaves behind in memory slows the other down."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(measured, path, **how).result()


def against_the_parser_of_py_trees(text: str, what: str) -> None:
    """Compare with py_trees' own XML parser (from 2.6 on), on a tree that both can read."""
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as file:
        file.write(text)
        file.flush()
        fast, checked = alone(ours, file.name, checked=False), alone(ours, file.name, checked=True)
        plain, paused = alone(theirs, file.name, paused=False), alone(theirs, file.name, paused=True)
    print(f"{what}, from file to tree: {fast * 1e3:.0f} ms, with all checks {checked * 1e3:.0f} ms")
    print(
        f"  py_trees' own parser: {plain:.2f} s, {plain / fast:.1f} and {plain / checked:.1f} times as long; with the "
        f"garbage collector paused {paused:.2f} s, {paused / fast:.1f} and {paused / checked:.1f}"
    )


def main() -> None:
    """Measure the sizes named on the command line."""
    sizes = [int(text) for text in sys.argv[1:]] or [100, 1_000, 10_000, 100_000]
    for size in sizes:
        measure(size)
    if find_spec("py_trees.parsers") is None:
        print("this py_trees has no XML parser")
        return
    most = min(10_000, max(sizes))
    text = written(most)
    against_the_parser_of_py_trees(text, f"{most} leaves without ports")
    # One writes what all others read.
    text = text.replace("<Leaf", '<Writer y="{key}"', 1).replace("<Leaf", '<Reader x="{key}"')
    against_the_parser_of_py_trees(text, f"{most} leaves with a port each")


if __name__ == "__main__":
    main()
