"""Small random trees of all kinds of controls and decorators, with conditions and scripts."""

import random

_CONTROLS = {
    "Sequence": (2, 3),
    "Fallback": (2, 3),
    "ReactiveSequence": (2, 3),
    "ReactiveFallback": (2, 3),
    "SequenceWithMemory": (2, 3),
    "AsyncSequence": (2, 3),
    "ParallelAll": (2, 2),
    "IfThenElse": (2, 3),
    "WhileDoElse": (2, 3),
}
_DECORATORS = (
    "Inverter",
    "ForceSuccess",
    "ForceFailure",
    "KeepRunningUntilFailure",
    'RetryUntilSuccessful num_attempts="2"',
    'Repeat num_cycles="2"',
    "RunOnce",
    'Retry num_failures="2"',
    'Repeat num_success="2"',
    "SuccessIsRunning",
    "FailureIsRunning",
    'OneShot policy="ON_SUCCESSFUL_COMPLETION"',
)
_LEAVES = (
    "<X/>",
    "<Y/>",
    "<Z/>",
    "<P/>",
    '<Script code="n = n == 2 ? 0 : n + 1"/>',
    '<ScriptCondition code="n == 1"/>',
)
_EXTRAS = (
    ' _skipIf="n == 1"',
    ' _failureIf="n == 2"',
    ' _while="n != 2"',
    ' _onSuccess="n = 1"',
    ' _onHalted="n = 2"',
    ' oneshot="ON_COMPLETION"',
)


def random_tree(seed: int) -> str:
    """Return the elements of a tree."""
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    inner = _node(chance, chance.randint(1, 3))
    return f'<Sequence><Script code="n := 0" oneshot="ON_COMPLETION"/>{inner}</Sequence>'


def random_parallel(seed: int) -> str:
    """Return the elements of a tree with three or four parallel branches."""
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    count = chance.randint(3, 4)
    branches = "".join(_node(chance, 1) for _ in range(count))
    limits = f'success_count="{chance.randint(1, count)}" failure_count="{chance.randint(1, count)}"'
    around = chance.choice(("Sequence", "ReactiveSequence", "Fallback"))
    script = '<Script code="n := 0" oneshot="ON_COMPLETION"/>'
    return f"<Sequence>{script}<{around}><X/><Parallel {limits}>{branches}</Parallel></{around}></Sequence>"


def _node(chance: random.Random, depth: int) -> str:
    extra = chance.choice(_EXTRAS) if chance.random() < 0.2 else ""
    kind = chance.random()
    if depth == 0 or kind < 0.3:
        return chance.choice(_LEAVES).replace("/>", f"{extra}/>")
    if kind < 0.6:
        tag = chance.choice(_DECORATORS)
        return f"<{tag}{extra}>{_node(chance, depth - 1)}</{tag.split()[0]}>"
    tag = chance.choice(list(_CONTROLS))
    count = chance.randint(*_CONTROLS[tag])
    return f"<{tag}{extra}>{''.join(_node(chance, depth - 1) for _ in range(count))}</{tag}>"
