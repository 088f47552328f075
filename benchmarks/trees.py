"""Tree files of any size that this project, BehaviorTree.CPP and the builder in `peer.py` read alike."""

import itertools
import random
from collections.abc import Callable, Iterable, Mapping

FAN_OUT = 10


def document(body: str) -> str:
    """Return a file with one tree."""
    return (
        '<root BTCPP_format="4" main_tree_to_execute="Main">\n'
        f'<BehaviorTree ID="Main">\n{body}\n</BehaviorTree>\n</root>\n'
    )


def around(opening: str, nodes: Iterable[str]) -> str:
    """Return a node around others, with one in each line; the first word of its tag closes it."""
    return "\n".join([f"<{opening}>", *nodes, f"</{opening.partition(' ')[0]}>"])


def sequence(nodes: Iterable[str]) -> str:
    """Return a sequence."""
    return around("Sequence", nodes)


def balanced(nodes: Iterable[str]) -> str:
    """Return sequences of sequences with nodes at their ends."""
    level = list(nodes)
    while len(level) > 1:
        level = [sequence(level[start : start + FAN_OUT]) for start in range(0, len(level), FAN_OUT)]
    return level[0]


def leaves(count: int, tag: str = "Leaf") -> list[str]:
    """Return leaves; each has a name of its own."""
    return [f'<{tag} name="n{number}"/>' for number in range(count)]


def in_turn(*forms: str) -> Callable[[int], list[str]]:
    """Return nodes that take turns; as many as there are forms have the same number."""

    def nodes(count: int) -> list[str]:
        turns = zip(range(count), itertools.cycle(forms), strict=False)
        return [form.format(number // len(forms)) for number, form in turns]

    return nodes


scripts = in_turn('<Script code="k{0} := 1"/>', '<ScriptCondition code="k{0} == 1"/>')
"""Each entry is written, then read."""


def copies(count: int) -> list[str]:
    """Return nodes of which each reads the entry that the one before has written."""
    inner = (f'<SetBlackboard value="{{k{at}}}" output_key="k{at + 1}"/>' for at in range(count - 1))
    return ['<Script code="k0 := 1"/>', *inner]


def deep(levels: int) -> str:
    """Return sequences in each other, each with a leaf before the next one."""
    body = '<Leaf name="last"/>'
    for level in reversed(range(levels - 1)):
        body = sequence([f'<Leaf name="n{level}"/>', body])
    return body


def one_running(count: int) -> str:
    """Return a balanced tree whose last leaf runs on, with all before it done: how a mission mostly is."""
    return balanced([*leaves(count - 1), around("KeepRunningUntilFailure", leaves(1))])


def skippable(count: int) -> str:
    """Return leaves of which each asks first whether it is to be skipped, and is not."""
    asked = (f'<Leaf name="n{number}" _skipIf="battery == 0"/>' for number in range(count - 1))
    return balanced(['<Script code="battery := 7"/>', *asked])


def navigating(count: int) -> str:
    """Return what Nav2's trees are like: a path is followed, with recoveries behind it; so many leaves in all.

    Nav2's own controls are BehaviorTree.CPP's that come nearest, so that both engines have them.
    """
    recoveries = [sequence(leaves(max(2, count - 6))), *leaves(1)]
    path = around("Fallback", [*leaves(1), *leaves(1)])
    follow = around("Fallback", [around("KeepRunningUntilFailure", leaves(1)), *leaves(1)])
    drive = around("ReactiveSequence", [path, follow])
    tries = around("Fallback", [drive, around("ReactiveFallback", recoveries)])
    return around('RetryUntilSuccessful num_attempts="6"', [tries])


_WRAPPERS = (
    "Inverter",
    "ForceSuccess",
    "ForceFailure",
    'RetryUntilSuccessful num_attempts="2"',
    'Repeat num_cycles="2"',
)
_WRAPPED, _RUNNING = 0.3, 0.05
_CONTROLS = (
    "Sequence",
    "Sequence",
    "Fallback",
    "Fallback",
    "ReactiveSequence",
    "ReactiveFallback",
    "IfThenElse",
)


def mixed(count: int) -> str:
    """Return controls, decorators, scripts and leaves by chance, of a fixed seed, with about so many leaves."""
    draw = random.Random(count)  # noqa: S311 - the same tree in every run
    level = [_mixed_leaf(draw, number) for number in range(count)]
    while len(level) > 1:
        some, level = iter(level), []
        while inner := list(itertools.islice(some, draw.randint(2, 5))):
            tag = draw.choice(_CONTROLS)
            whole = around("Sequence" if tag == "IfThenElse" and len(inner) not in (2, 3) else tag, inner)
            level.append(around(draw.choice(_WRAPPERS), [whole]) if draw.random() < _WRAPPED else whole)
    return level[0]


def _mixed_leaf(draw: random.Random, number: int) -> str:
    kinds = (
        f'<Leaf name="n{number}"/>',
        "<AlwaysSuccess/>",
        "<AlwaysFailure/>",
        f'<Script code="k{number % 9} := {number}"/>',
    )
    leaf = draw.choice(kinds)
    return around("KeepRunningUntilFailure", [leaf]) if draw.random() < _RUNNING else leaf


_PARALLEL = 'Parallel success_count="-1" failure_count="1"'

SHAPES: Mapping[str, Callable[[int], str]] = {
    "wide": lambda count: sequence(leaves(count)),
    "balanced": lambda count: balanced(leaves(count)),
    "one leaf runs": one_running,
    "built-in leaves": lambda count: balanced(["<AlwaysSuccess/>"] * count),
    "leaves that begin and end": lambda count: balanced(leaves(count, "Prepared")),
    "mixed": mixed,
    "deep": deep,
    "ports": lambda count: balanced(copies(count)),
    "scripts": lambda count: balanced(scripts(count)),
    "conditions": skippable,
    "Nav2's shape": navigating,
    "parallel": lambda count: around(_PARALLEL, leaves(count)),
    "parallel, all running": lambda count: around(
        _PARALLEL, [around("KeepRunningUntilFailure", [leaf]) for leaf in leaves(count)]
    ),
}
"""What trees are like, by a name for it; each makes the tree with so many leaves."""
