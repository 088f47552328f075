"""What it costs to come from a file to a tree, step by step and as a whole.

Reading is compared with expat and handlers that do nothing, checking, binding and making the tree flat with reading, and
compiling with the same tree built by hand-written py_trees constructors, during which the garbage collector pauses as it
does while a tree is compiled. The whole is compared with what BehaviorTree.CPP takes for the same file and, on files that it can
read, with py_trees' own parser.
"""

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.parsers import expat

from py_trees import composites
from py_trees.behaviour import Behaviour

from benchmarks import trees
from benchmarks.figures import Effort, Missing, Result, compared, in_turns, timed, traced_peak
from benchmarks.leaves import Leaf, registry_with_leaves
from benchmarks.peers import COMPILED, PY_TREES, Peer, RefusedError, peers
from sar_compiler.checks import check
from sar_compiler.compiler import CompiledTree, bind_main, preview_tree
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.gc_pause import gc_paused
from sar_compiler.tree.xml import parse_xml

EXPAT, READ, BY_HAND = "expat", "read", "py_trees by hand"
THEIR_PARSER = "py_trees' own parser"
SIZE = 10_000
SIZES = (100, SIZE, 100_000)
SHAPES = ("balanced", "ports", "scripts")
CREATED = 5_000
PARSED = f"read, bind, compile {SIZE:,} leaves"
PARSED_WITH_PORTS = f"{PARSED} with a port each"


def subject(shape: str) -> str:
    """Return what all steps of a tree are called in the tables."""
    return f"read, check, bind, compile {SIZE:,} leaves ({shape})"


def created(shape: str) -> str:
    """Return what it is called that a tree is made without checks."""
    return f"read, bind, compile {CREATED:,} leaves ({shape})"


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the figures of every step, of every shape, and beside the other libraries."""
    for size in SIZES:
        text = trees.document(trees.balanced(trees.leaves(effort.size(size))))
        yield from _steps(size, text, effort.few if size > SIZE else effort.rounds)
    with tempfile.TemporaryDirectory() as folder, peers(COMPILED, PY_TREES) as others:
        for engine in {COMPILED, PY_TREES} - others.keys():
            yield Missing("", THEIR_PARSER if engine == PY_TREES else engine, "it is not installed")
        path = Path(folder, "tree.xml")
        for shape in SHAPES:
            text = trees.document(trees.SHAPES[shape](effort.size(SIZE)))
            path.write_text(text, encoding="utf-8")
            theirs = _loading(others.get(COMPILED), path)
            yield from _whole(subject(shape), text, theirs, effort.rounds, is_checked=True)
        for shape in SHAPES:
            text = trees.document(trees.SHAPES[shape](effort.size(CREATED)))
            path.write_text(text, encoding="utf-8")
            theirs = _loading(others.get(COMPILED), path)
            yield from _whole(created(shape), text, theirs, effort.rounds, is_checked=False)
        ports = ['<Writer y="{key}"/>', *['<Reader x="{key}"/>'] * (effort.size(SIZE) - 1)]
        for name, nodes in ((PARSED, trees.leaves(effort.size(SIZE))), (PARSED_WITH_PORTS, ports)):
            path.write_text(trees.document(trees.balanced(nodes)), encoding="utf-8")
            yield from _parsed(name, path, others.get(PY_TREES), effort.few)


def _steps(size: int, text: str, rounds: int) -> Iterator[Result]:
    """Yield the figures of single steps, and of memory."""
    registry = registry_with_leaves()
    forest = Forest.of(parse_xml(text))
    binding = bind_main(forest, registry)
    root = preview_tree(binding).root
    body = ET.fromstring(text)[0][0]  # noqa: S314 - a text of our own

    def by_hand() -> Behaviour:
        with gc_paused():
            return _built(body)

    taken = in_turns(
        {
            EXPAT: lambda: timed(lambda: _scan(text.encode())),
            READ: lambda: timed(lambda: parse_xml(text)),
            "check": lambda: timed(lambda: check(forest, registry)),
            "bind": lambda: timed(lambda: bind_main(forest, registry)),
            "make flat": lambda: timed(lambda: LiveTree(root)),
            "compile": lambda: timed(lambda: preview_tree(binding)),
            BY_HAND: lambda: timed(by_hand),
        },
        rounds,
    )
    beside = {READ: EXPAT, "check": READ, "bind": READ, "make flat": READ, "compile": BY_HAND}
    for step, reference in beside.items():
        yield from compared(f"{step} {size:,} leaves", taken[step], {reference: taken[reference]})
    if size == SIZE:
        ours = traced_peak(lambda: preview_tree(bind_main(Forest.of(parse_xml(text)), registry)))
        yield from compared(f"memory of {size:,} leaves", [ours], {BY_HAND: [traced_peak(by_hand)]}, "bytes")


def _whole(
    name: str, text: str, theirs: Callable[[], float] | None, rounds: int, *, is_checked: bool
) -> Iterator[Result]:
    """Yield what all steps take, with or without the checks, beside BehaviorTree.CPP if it is there."""
    registry = registry_with_leaves()

    def made() -> CompiledTree:
        forest = Forest.of(parse_xml(text))
        if is_checked:
            check(forest, registry)
        return preview_tree(bind_main(forest, registry))

    actions = {"": lambda: timed(made), EXPAT: lambda: timed(lambda: _scan(text.encode()))}
    taken = in_turns(actions | ({COMPILED: theirs} if theirs else {}), rounds)
    yield from compared(name, taken.pop(""), taken)


def _loading(peer: Peer | None, path: Path) -> Callable[[], float] | None:
    return None if peer is None else lambda: peer.load(path)


def _parsed(name: str, path: Path, peer: Peer | None, rounds: int) -> Iterator[Result]:
    """Yield what it takes without checks, beside py_trees' own parser (from 2.6 on)."""
    registry = registry_with_leaves()
    if peer is None:
        return

    def made() -> CompiledTree:
        return preview_tree(bind_main(Forest.of(parse_xml(path.read_bytes())), registry))

    try:
        taken = in_turns({"": lambda: timed(made), THEIR_PARSER: lambda: peer.parse(path)}, rounds)
    except RefusedError as error:
        yield Missing(name, THEIR_PARSER, str(error))
        return
    yield from compared(name, taken.pop(""), taken)


def _built(element: ET.Element) -> Behaviour:
    if element.tag == "Leaf":
        return Leaf(element.attrib["name"])
    return composites.Sequence(element.tag, memory=True, children=[_built(child) for child in element])


def _scan(data: bytes) -> None:
    """Parse with handlers that do nothing."""
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda *_: None
    parser.EndElementHandler = lambda *_: None
    parser.Parse(data, True)  # noqa: FBT003
