"""What large files cost, and how that grows when they are ten times as large: correct ones, and ones full of mistakes.

Read, check and, without errors, bind and compile. Each kind of file is measured in a process of its own, one with as many of
it as said and one with a tenth of them in turns; so the most memory that the process had is that of the larger one.
"""

from collections.abc import Callable, Iterator, Mapping

from benchmarks.figures import (
    LOOP,
    Effort,
    Figure,
    Result,
    alone,
    compared,
    in_turns,
    loop,
    most_memory,
    plain,
    timed,
)
from benchmarks.leaves import registry_with_leaves
from benchmarks.trees import balanced, document, in_turn, scripts, sequence
from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes.registry import Registry
from sar_compiler.tree.diagnostic import Severity
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml

SIZE = 100_000
_MOST_ATTRIBUTES = 1_000
TENTH = "a tenth of it"
SLOWEST = "the slowest of these"
# The longest part of all benchmarks.
_ROUNDS = 2


def _of(*forms: str) -> Callable[[int], str]:
    nodes = in_turn(*forms)
    return lambda count: balanced(nodes(count))


def _with_many_attributes(count: int) -> str:
    """Return elements with so many attributes that they do not have, as many in each as one may have."""
    attributes = " ".join(f'foo{number}="1"' for number in range(min(count, _MOST_ATTRIBUTES)))
    return balanced([f"<AlwaysSuccess {attributes}/>"] * max(count // _MOST_ATTRIBUTES, 1))


FILES: Mapping[str, Callable[[int], str]] = {
    "leaves": _of('<AlwaysSuccess name="n{0}"/>'),
    "a port each": _of('<Writer y="{{k{0}}}"/>', '<Reader x="{{k{0}}}"/>'),
    "a port each, of one key": lambda count: balanced(
        ['<Writer y="{k}"/>'] + ['<Reader x="{k}"/>'] * (count - 1)
    ),
    "a script each": lambda count: balanced(scripts(count)),
    "comments": _of('<!-- about it -->\n<AlwaysSuccess name="n{0}"/>'),
    "unknown attributes, a thousand an element": _with_many_attributes,
    "mistakes of two kinds": _of("<Foo{0}/>", '<Delay delay_msec="x"><AlwaysSuccess/></Delay>'),
    "postconditions that nobody reads": _of('<AlwaysSuccess _onSuccess="k{0} := 1"/>'),
    "keys that are misspelt": _of('<Script code="key{0} := 1"/>', '<ScriptCondition code="kye{0} == 1"/>'),
    "one key, written, then read": lambda count: sequence(
        ['<Script code="k := 1"/>'] * (count // 2) + ['<ScriptCondition code="k == 1"/>'] * (count // 2)
    ),
}


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the figures of each kind of file, and those of the slowest once more."""
    slowest: list[Figure] = []
    for name in FILES:
        figures = alone(_of_kind, name, effort)
        slowest = max(slowest, figures[:2], key=lambda each: each[0].ours if each else 0.0)
        yield from figures
    yield from (figure._replace(subject=SLOWEST) for figure in slowest)


def _of_kind(name: str, effort: Effort) -> list[Figure]:
    registry = registry_with_leaves()
    whole, tenth = (document(FILES[name](effort.size(SIZE) // parts)) for parts in (1, 10))
    actions = {
        "": lambda: timed(lambda: _processed(whole, registry)),
        TENTH: lambda: timed(lambda: _processed(tenth, registry)),
        LOOP: loop,
    }
    taken = in_turns(actions, min(effort.rounds, _ROUNDS))
    memory = plain(f"{name}: memory", most_memory(), "bytes")
    return [*compared(name, taken.pop(""), taken), memory]


def _processed(text: str, registry: Registry) -> object:
    """Do all steps from a text to its findings and, without errors, to the tree."""
    forest = Forest.of(parse_xml(text))
    findings = check(forest, registry)
    if any(finding.severity is Severity.ERROR for finding in findings):
        return forest, findings
    binding = bind_main(forest, registry)
    return forest, findings, binding, preview_tree(binding)
