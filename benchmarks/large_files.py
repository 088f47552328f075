"""What large files cost, and how that grows when they are twice as large: correct ones, and ones full of mistakes.

Run it with `make bench`, or `python benchmarks/large_files.py 50000` for another size. Times are seconds of the
processor, medians of several runs; the steps of one file run in turn with those of one half as large. Memory is the
most that Python holds at a time from the text to the findings and the tree, as `tracemalloc` counts it, in a run of
its own; the last line has the most that the process had.
"""

import gc
import itertools
import resource
import statistics
import sys
import time
import tracemalloc
from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

from port_leaves import Reader, Writer

from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.tree.diagnostic import Severity
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml

T = TypeVar("T")

SIZE = 100_000
RUNS = 3
FAN_OUT = 10
MEBIBYTE = 2**20
# getrusage counts in these.
KIBIBYTES = 1024


def alternately(*forms: str) -> Callable[[int], str]:
    """Return nodes that take turns, in a balanced tree; as many as there are forms have the same number."""

    def text(count: int) -> str:
        turns = zip(range(count), itertools.cycle(forms), strict=False)
        return balanced([form.format(number // len(forms)) for number, form in turns])

    return text


def balanced(nodes: Iterable[str]) -> str:
    """Return sequences of sequences with nodes at their ends."""
    level = list(nodes)
    while len(level) > 1:
        level = [sequence(level[start : start + FAN_OUT]) for start in range(0, len(level), FAN_OUT)]
    return level[0]


def sequence(nodes: Iterable[str]) -> str:
    """Return a sequence, with one node in each line."""
    return "\n".join(["<Sequence>", *nodes, "</Sequence>"])


def in_one_element(count: int) -> str:
    """Return an element with so many attributes that it does not have."""
    attributes = " ".join(f'foo{number}="1"' for number in range(count))
    return f"<AlwaysSuccess {attributes}/>"


FILES: Mapping[str, Callable[[int], str]] = {
    "leaves": alternately('<AlwaysSuccess name="n{0}"/>'),
    "a port each": alternately('<Writer y="{{k{0}}}"/>', '<Reader x="{{k{0}}}"/>'),
    "a port each, of one key": lambda count: balanced(
        ['<Writer y="{k}"/>'] + ['<Reader x="{k}"/>'] * (count - 1)
    ),
    "a script each": alternately('<Script code="k{0} := 1"/>', '<ScriptCondition code="k{0} == 1"/>'),
    "comments": alternately('<!-- about it -->\n<AlwaysSuccess name="n{0}"/>'),
    "unknown attributes in one element": in_one_element,
    "mistakes of two kinds": alternately("<Foo{0}/>", '<Delay delay_msec="x"><AlwaysSuccess/></Delay>'),
    "postconditions that nobody reads": alternately('<AlwaysSuccess _onSuccess="k{0} := 1"/>'),
    "keys that are misspelt": alternately(
        '<Script code="key{0} := 1"/>', '<ScriptCondition code="kye{0} == 1"/>'
    ),
    "one key, written, then read": lambda count: sequence(
        ['<Script code="k := 1"/>'] * (count // 2) + ['<ScriptCondition code="k == 1"/>'] * (count // 2)
    ),
}


def document(body: str) -> str:
    """Return a file with one tree."""
    return f'<root BTCPP_format="4">\n<BehaviorTree ID="Main">\n{body}\n</BehaviorTree>\n</root>\n'


class Steps:
    """The steps from the text of a file to its findings and, without errors, to the tree.

    Args:
        text: The text.
        registry: What tags mean.
    """

    def __init__(self, text: str, registry: Registry) -> None:
        self._text = text
        self._registry = registry
        self.seconds: dict[str, list[float]] = {}

    def run(self) -> object:
        """Do all steps; note what each has taken."""
        registry = self._registry
        forest = Forest.of(self._timed("read", lambda: parse_xml(self._text)))
        findings = self._timed("check", lambda: check(forest, registry))
        if any(finding.severity is Severity.ERROR for finding in findings):
            return forest, findings
        binding = self._timed("bind", lambda: bind_main(forest, registry))
        return forest, findings, self._timed("compile", lambda: preview_tree(binding))

    def medians(self) -> dict[str, float]:
        """Return the median of each step, and their sum."""
        medians = {name: statistics.median(taken) for name, taken in self.seconds.items()}
        return {**medians, "all": sum(medians.values())}

    def _timed(self, name: str, action: Callable[[], T]) -> T:
        gc.collect()
        start = time.process_time()
        made = action()
        self.seconds.setdefault(name, []).append(time.process_time() - start)
        return made


def peak(action: Callable[[], object]) -> int:
    """Return the most memory that an action holds at a time, in bytes."""
    gc.collect()
    tracemalloc.start()
    kept = action()
    size = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    del kept
    return size


def measure(name: str, size: int, registry: Registry) -> None:
    """Print the figures for one kind of file."""
    half, whole = (Steps(document(FILES[name](count)), registry) for count in (size // 2, size))
    for _ in range(RUNS):
        for each in (half, whole):
            each.run()
    before, after = half.medians(), whole.medians()
    memory = peak(whole.run) / MEBIBYTE
    columns = "  ".join(f"{step} {after[step]:6.2f} s (x{after[step] / before[step]:4.1f})" for step in after)
    print(f"{name:34} {columns}  {memory:5.0f} MiB", flush=True)


def main(size: int) -> None:
    """Measure each kind of file."""
    leaves = [NodeSpec(cls.__name__, cls, Kind.ACTION) for cls in (Reader, Writer)]
    registry = Registry([*default_registry().specs(), *leaves])
    print(f"{size:,} of each; in brackets, how many times as long as half of them")
    for name in FILES:
        measure(name, size, registry)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / KIBIBYTES
    print(f"the process had {most:.0f} MiB at most")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SIZE)
