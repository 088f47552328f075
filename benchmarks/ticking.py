"""What a tick costs, beside calling the leaves' `update` alone, and beside other libraries.

All of them tick the tree of the same file. The leaves do nothing but answer; a bare call of one is what no engine can
do without. BehaviorTree.CPP has leaves in C++ in their place and, in another column, leaves in Python.
"""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from benchmarks.figures import Effort, Missing, Result, compared, in_turns, often, timed
from benchmarks.leaves import Leaf, registry_with_leaves
from benchmarks.peers import COMPILED, COMPILED_WITH_PYTHON, PY_TREES, Peer, RefusedError, peers
from benchmarks.trees import SHAPES, document
from sar_compiler.compiler import bind_main, compile_tree, preview_tree
from sar_compiler.nodes.registry import default_registry
from sar_compiler.resources import shipped
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.kernel.tree_nodes import Visit
from sar_compiler.tree.forest import Forest, load_forest
from sar_compiler.tree.gathering import read_tree_file
from sar_compiler.tree.xml import parse_xml

BARE = "bare calls"
OWN_METHODS = "py_trees on the same objects"
UNSEEN = "the same without a visitor"
TREE = "search_and_rescue"
SIZES = (100, 1_000, 10_000)
# Tree files are nested no deeper than 200 elements.
LEVELS = (100, 190)
MANY = 100_000
# As many leaves as trees of Nav2 have.
OF_NAV2 = (12, 30)
# Shapes that are measured with so many leaves as well.
LARGE = ("balanced", "one leaf runs")
# What the leaves of the shipped tree answer; those that are not named succeed.
SITUATIONS: Mapping[str, Mapping[str, Status]] = {
    "driving to a zone": {"NavigateToZone": Status.RUNNING},
    "reporting": {"NotifyBase": Status.RUNNING},
    "a whole zone in one tick": {},
    "driving home": {"ZonesRemaining?": Status.FAILURE, "NavigateToBase": Status.RUNNING},
}


def subject(shape: str, size: int) -> str:
    """Return what a tree is called in the tables."""
    return f"{shape}, {size:,} {'levels' if shape == 'deep' else 'leaves'}"


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the figures of the shipped tree in its situations, and of trees of all shapes and sizes."""
    for situation, answers in SITUATIONS.items():
        yield from _in_situation(situation, answers, effort)
    with peers(COMPILED, COMPILED_WITH_PYTHON, PY_TREES) as others, tempfile.TemporaryDirectory() as folder:
        for engine in {COMPILED, COMPILED_WITH_PYTHON, PY_TREES} - others.keys():
            yield Missing("", engine, "it is not installed")
        for shape in SHAPES:
            for size in _sizes(shape):
                path = Path(folder, "tree.xml")
                path.write_text(document(SHAPES[shape](effort.size(size))), encoding="utf-8")
                yield from _of_file(subject(shape, size), path, others, effort)


def _sizes(shape: str) -> tuple[int, ...]:
    special = {"deep": LEVELS, "Nav2's shape": OF_NAV2, **dict.fromkeys(LARGE, (*SIZES, MANY))}
    return special.get(shape, SIZES)


def _in_situation(situation: str, answers: Mapping[str, Status], effort: Effort) -> Iterator[Result]:
    live, stock = LiveTree(_shipped(answers)), _shipped(answers)
    actions = _ticks(live) | {OWN_METHODS: _often(stock.tick_once)}
    taken = in_turns(actions, effort.rounds)
    same = [node.status for node in live.root.iterate()] == [node.status for node in stock.iterate()]
    assert same, "the two do not do the same"
    yield from compared(f"{TREE}, {situation}", taken.pop(""), taken)


def _of_file(name: str, path: Path, others: Mapping[str, Peer], effort: Effort) -> Iterator[Result]:
    binding = bind_main(Forest.of(parse_xml(path.read_bytes())), registry_with_leaves())
    live = LiveTree(compile_tree(binding, {}, {}).root)
    actions = _ticks(live)
    for engine, peer in others.items():
        if engine == COMPILED_WITH_PYTHON and BARE not in actions:
            continue  # its leaves in Python are those that this project has in Python
        try:
            peer.load(path)
            actions[engine] = often(peer.tick)
        except RefusedError as error:
            yield Missing(name, engine, str(error))
    taken = in_turns(actions, effort.few if len(live.nodes) > MANY else effort.rounds)
    yield from compared(name, taken.pop(""), taken)
    if name == subject("balanced", SIZES[-1]):
        watched = {"": _often(lambda: live.tick_and_visit([])), UNSEEN: actions[""]}
        taken = in_turns(watched, effort.rounds)
        yield from compared(f"{name}, with a visitor", taken.pop(""), taken)


def _ticks(live: LiveTree) -> dict[str, Callable[[], float]]:
    """Return what ticks the tree and, if its leaves are in Python, what calls those that it has ticked."""
    visits: list[Visit] = []
    live.tick(visits)
    ticked = [visit.behaviour for visit in visits if not visit.behaviour.children]

    def call() -> None:
        for leaf in ticked:
            leaf.update()

    bare = {BARE: _often(call)} if all(isinstance(leaf, Leaf) for leaf in ticked) else {}
    return {"": _often(live.tick), **bare}


def _often(action: Callable[[], object]) -> Callable[[], float]:
    return often(lambda count: timed(action, count))


def _shipped(answers: Mapping[str, Status]) -> Behaviour:
    """Return the shipped tree with leaves that answer as wanted."""
    forest = load_forest(Path(shipped("trees", f"{TREE}.xml")), read_tree_file)
    root = preview_tree(bind_main(forest, default_registry())).root
    for node in list(root.iterate()):
        if not node.children and node.parent is not None:
            leaf = Leaf(node.name, answers.get(node.name, Status.SUCCESS))
            leaf.parent = node.parent
            node.parent.children[node.parent.children.index(node)] = leaf
            if hasattr(node.parent, "decorated"):
                node.parent.decorated = leaf
    return root
