"""The scripts of the leaves of a scenario: `leaves:`."""

from collections.abc import Sequence

from sar_compiler.checks.leaf_words import LeafWords
from sar_compiler.checks.simulate.run_variables import OWN
from sar_compiler.checks.simulate.scenario import AnswerStep
from sar_compiler.checks.typed_values import span_sec
from sar_compiler.compiler.simulated_tree import match_rank
from sar_compiler.documents.located import Document, Value
from sar_compiler.runtime.stub_leaf import StubLeaf

_ALWAYS = "always"


def read_scripts(
    document: Document, value: Value, words: LeafWords
) -> dict[StubLeaf, tuple[AnswerStep, ...]]:
    """Return the steps of each leaf of which a scenario says something.

    Where several keys name a leaf, its path counts before its name, and its name before its tag.
    """
    scripts: dict[StubLeaf, tuple[AnswerStep, ...]] = {}
    ranks: dict[StubLeaf, int] = {}
    for key, inner in value.entries or ():
        leaves = words.find(document, key)
        steps = _steps(document, inner, words, leaves)
        for leaf in leaves:
            rank = match_rank(key.text or "", leaf.path, leaf.tag)
            if rank > ranks.get(leaf, 0):
                scripts[leaf], ranks[leaf] = steps, rank
    return scripts


def _steps(
    document: Document, value: Value, words: LeafWords, leaves: Sequence[StubLeaf]
) -> tuple[AnswerStep, ...]:
    """Read one step that is always taken, or a list of steps that are taken once each, but for those every n-th time."""
    one = value.items is None
    steps = [_step(document, item, words, leaves, always=one) for item in value.listed]
    return tuple(step for step in steps if step is not None)


def _step(
    document: Document, value: Value, words: LeafWords, leaves: Sequence[StubLeaf], *, always: bool
) -> AnswerStep | None:
    times = None if always else 1
    if value.entries is None:
        answer = words.answer(document, value, leaves) if leaves else None
        return None if answer is None else AnswerStep(answer, times=times)
    parts = value.mapping
    answer = words.answer(document, parts["answer"], leaves) if leaves else None
    after = parts.get("after")
    if after is not None:
        _check_running(document, after, leaves)
    least, longest = span_sec(after) if after else (0.0, 0.0)
    step = AnswerStep(
        answer or "",
        after_sec=least,
        longest_sec=longest,
        when=words.condition(document, parts.get("when"), OWN),
        times=_times(parts["times"]) if "times" in parts else None if "every" in parts else times,
        every=int(parts["every"].data) if "every" in parts else 1,
        chance=float(parts["chance"].data) if "chance" in parts else 1.0,
    )
    return step if answer is not None else None


def _times(value: Value) -> int | None:
    return None if value.data == _ALWAYS else int(value.data)


def _check_running(document: Document, value: Value, leaves: Sequence[StubLeaf]) -> None:
    for leaf in leaves:
        if all(answer.status != "RUNNING" for answer in leaf.answers):
            message = f"'{leaf.name}' answers at once: it never runs, so nothing can come after a time"
            document.report("wrong-value", message, value, hint="leave 'after' out")
