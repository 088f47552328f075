"""Tree files of any size that both this project and BehaviorTree.CPP can read."""

import itertools
import random
from collections.abc import Callable, Iterable, Mapping

FAN_OUT = 10
_PALETTE = '<TreeNodesModel><Action ID="Try"/><Condition ID="Check"/></TreeNodesModel>\n'


def document(body: str, tree_id: str = "Main") -> str:
    """Return a file with one tree."""
    return (
        f'<root BTCPP_format="4" main_tree_to_execute="{tree_id}">\n'
        f'<BehaviorTree ID="{tree_id}">\n{body}\n</BehaviorTree>\n</root>\n'
    )


def described(body: str, tree_id: str = "Main") -> str:
    """Return a file with one tree whose leaves are `Try`, an action, and `WrittenComparison`, a condition."""
    return document(body, tree_id).replace("</root>", f"{_PALETTE}</root>")


def around(opening: str, nodes: Iterable[str]) -> str:
    """Return a node around others, with one in each line; the first word of the opening is its tag."""
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


def in_turn(*forms: str) -> Callable[[int], list[str]]:
    """Return a function that makes nodes of several forms in turn; each group of forms shares a number."""

    def nodes(count: int) -> list[str]:
        turns = zip(range(count), itertools.cycle(forms), strict=False)
        return [form.format(number // len(forms)) for number, form in turns]

    return nodes


def mission(seed: int, tree_id: str = "Main", *, has_scripts: bool = False) -> str:
    """Return a file with a typical mission of some 20 to 60 nodes: steps, fallbacks, checks, retries, time limits."""
    draw = random.Random(seed)  # noqa: S311 - the same tree in every run
    numbers = itertools.count()

    def leaf(tag: str) -> str:
        return f'<{tag} name="{tag}{next(numbers)}"/>'

    def step(depth: int) -> str:
        kind = draw.random()
        if depth == 0 or kind < 0.2:  # noqa: PLR2004 - shares of kinds
            return leaf("Try")
        inner = [step(depth - 1) for _ in range(draw.randint(2, 3))]
        wrappers = (
            lambda: around("Fallback", inner[:2]),
            lambda: around("Fallback", [leaf("Check"), inner[0]]),
            lambda: around('RetryUntilSuccessful num_attempts="3"', [sequence(inner)]),
            lambda: around('Timeout msec="60000"', [sequence(inner)]),
            lambda: around("ReactiveSequence", [leaf("Check"), sequence(inner)]),
            lambda: around("SequenceWithMemory", inner),
        )
        return draw.choice(wrappers)()

    steps = [step(2) for _ in range(4)]
    if has_scripts:
        steps = ['<Script code="tries := 0"/>', *steps, '<Script code="tries = tries + 1"/>']
        steps.append('<ScriptCondition code="tries == 1"/>')
    return described(around('Sequence name="Mission"', steps), tree_id)


def navigation(recoveries: int) -> str:
    """Return a tree like Nav2's: it follows a path, with recoveries as fallback.

    Nav2's controls are replaced by the most similar ones of BehaviorTree.CPP, so that both engines have them.
    """
    done = "<Leaf/>"
    runs = around("KeepRunningUntilFailure", [done])
    path = around("Fallback", [done, done])
    follow = around("Fallback", [runs, done])
    drive = around("ReactiveSequence", [path, follow])
    recovery = around("ReactiveFallback", [sequence([done] * recoveries), done])
    return around('RetryUntilSuccessful num_attempts="6"', [around("Fallback", [drive, recovery])])


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
    """Return random controls, decorators, scripts and leaves with a fixed seed and about a number of leaves."""
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
        "<Leaf/>",
        "<AlwaysSuccess/>",
        "<AlwaysFailure/>",
        f'<Script code="k{number % 9} := {number}"/>',
    )
    leaf = draw.choice(kinds)
    return around("KeepRunningUntilFailure", [leaf]) if draw.random() < _RUNNING else leaf


def one_running(count: int) -> str:
    """Return a balanced tree whose last leaf keeps running after the others have succeeded."""
    leaves = ["<Leaf/>"] * (count - 1)
    return balanced([*leaves, around("KeepRunningUntilFailure", ["<Leaf/>"])])


_RUNS = around("KeepRunningUntilFailure", ["<AlwaysSuccess/>"])
_CASES = " ".join(f'case_{number}="{number}"' for number in range(1, 6))
CONSTRUCTS: Mapping[str, str] = {
    "Sleep": '<Sleep msec="100000000"/>',
    "Timeout": around('Timeout msec="100000000"', [_RUNS]),
    "Delay": around('Delay delay_msec="100000000"', ["<AlwaysSuccess/>"]),
    "_while": '<AlwaysSuccess _while="mode == 3"/>',
    "Switch5": around(f'Switch5 variable="{{mode}}" {_CASES}', ["<AlwaysSuccess/>"] * 6),
}
"""Nodes that are more expensive than others, by name."""


def of_constructs(construct: str, count: int) -> str:
    """Return a tree that ticks a construct a number of times in each tick."""
    parallel = around('Parallel success_count="-1" failure_count="1"', [construct] * count)
    return sequence(['<Script code="mode := 3"/>', parallel])
