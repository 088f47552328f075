"""Random trees with parallel branches, some of which share data."""

import random
import re

_LEAVES = ('<A name="a{0}"/>', '<B name="b{0}"/>', '<C name="c{0}"/>', '<P name="p{0}"/>')
_SHARING = (
    "<X/>",
    "<Y/>",
    "<Z/>",
    '<Script code="n = n == 2 ? 0 : n + 1"/>',
    '<ScriptCondition code="n == 1"/>',
)
_DECORATORS = (
    'RetryUntilSuccessful num_attempts="3"',
    'RetryUntilSuccessful num_attempts="2"',
    'Repeat num_cycles="2"',
    "Inverter",
    "ForceSuccess",
    "RunOnce",
    "SuccessIsRunning",
    'Timeout msec="100"',
    "KeepRunningUntilFailure",
)
_CONTROLS = (
    "Sequence",
    "Fallback",
    "ReactiveSequence",
    "ReactiveFallback",
    "SequenceWithMemory",
    "AsyncSequence",
)
_EXTRAS = (
    ' _skipIf="k{0} == 1"',
    ' _while="k{0} != 1"',
    ' _onSuccess="k{0} = k{0} == 1 ? 0 : 1"',
    ' _onHalted="k{0} = 1"',
    ' _onFailure="k{0} = u{0}"',
)
_AROUND = (
    "<ReactiveSequence><P/>{0}</ReactiveSequence>",
    "<Sequence><P/>{0}</Sequence>",
    "<Fallback>{0}<P/></Fallback>",
    '<RetryUntilSuccessful num_attempts="-1">{0}</RetryUntilSuccessful>',
    '<Repeat num_cycles="2">{0}</Repeat>',
    "<KeepRunningUntilFailure>{0}</KeepRunningUntilFailure>",
    '<Timeout msec="100">{0}</Timeout>',
    "<ReactiveFallback><P/>{0}</ReactiveFallback>",
    '<Delay delay_msec="10">{0}</Delay>',
    "{0}",
)


def random_branches(seed: int) -> str:
    """Return the elements of a tree."""
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    count = chance.choice((2, 2, 3, 3, 4))
    if chance.random() < 0.5:
        shape = _with_its_key(_branch(chance, chance.randint(0, 2), sharing=0.0))
        shapes = [shape] * count
        if chance.random() < 0.3:
            shapes[chance.randrange(count)] = _branch(chance, 1, sharing=0.1)
    else:
        shapes = [_with_its_key(_branch(chance, chance.randint(0, 2), sharing=0.1)) for _ in range(count)]
    branches = "".join(shape.replace("{0}", str(number)) for number, shape in enumerate(shapes))
    if chance.random() < 0.3:
        limits = f'max_failures="{chance.randint(0, count)}"'
        parallel = f"<ParallelAll {limits}>{branches}</ParallelAll>"
    else:
        success = chance.choice((count, count, -1, chance.randint(1, count)))
        limits = (
            f'success_count="{success}" failure_count="{chance.choice((1, 1, chance.randint(1, count)))}"'
        )
        parallel = f"<Parallel {limits}>{branches}</Parallel>"
    around = chance.choice(_AROUND).replace("{0}", parallel)
    return f'<Sequence><Script code="n := 0" oneshot="ON_COMPLETION"/>{around}</Sequence>'


def random_properties(tree: str, seed: int) -> str:
    """Return the text of a properties file about the leaves of such a tree."""
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    leaves = sorted(set(re.findall('name="([abcp][01])"', tree))) or ["P"]
    events = [f"{leaf} {deed}" for leaf in leaves for deed in ("SUCCESS", "FAILURE", "starts")]

    def event() -> str:
        return chance.choice(events)

    lines = [
        f"  p1: {{never: {event()}}}",
        f"  p2: {{before: {event()}, comes: {event()}}}",
        f"  p3: {{after: {event()}, eventually: {event()}}}",
        f"  p4: {{at_most_once: {event()}, per: {event()}}}",
        f"  p5: {{never: {event()}, while: n == 1}}",
        "  p6: {at_end: root == 'SUCCESS'}",
    ]
    return "properties:\n" + "\n".join(lines)


def _with_its_key(branch: str) -> str:
    """Return a branch that first sets its key, if it has one."""
    first = '<Script code="k{0} := 0" oneshot="ON_COMPLETION"/>'
    return f"<Sequence>{first}{branch}</Sequence>" if "k{0}" in branch else branch


def _branch(chance: random.Random, depth: int, *, sharing: float) -> str:
    extra = chance.choice(_EXTRAS) if chance.random() < 0.15 else ""
    kind = chance.random()
    if depth == 0 or kind < 0.15:
        leaves = _SHARING if chance.random() < sharing else _LEAVES
        return chance.choice(leaves).replace("/>", f"{extra}/>")
    if kind < 0.6:
        tag = chance.choice(_DECORATORS)
        return f"<{tag}{extra}>{_branch(chance, depth - 1, sharing=sharing)}</{tag.split()[0]}>"
    tag = chance.choice(_CONTROLS)
    inside = "".join(_branch(chance, depth - 1, sharing=sharing) for _ in range(2))
    return f"<{tag}{extra}>{inside}</{tag}>"
