"""What the records say of decorators beside their outcomes, held against what the decorators do."""

import math
from collections.abc import Iterator

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.compiler import bind_main, compile_tree
from sar_compiler.nodes.outcome_sets import RESULTS, F, K, R, S, bit_of
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.runtime.clock import Clock, ManualClock
from sar_compiler.runtime.skipping import SKIPPED, was_skipped
from sar_compiler.tree.diagnostic import TreeError
from tests.node_forms import forms
from tests.trees import forest

STATUSES = {S: Status.SUCCESS, F: Status.FAILURE, R: Status.RUNNING, K: SKIPPED}
FORMS = [form for form in forms() if form.spec.kind is Kind.DECORATOR and not form.reads_keys]
SPECS = {form.spec.tag + (" of py_trees" if form.spec.variant else ""): form.spec for form in FORMS}
TICKS = 6
RUN_ON = ("Condition", "SuccessIsRunning", "FailureIsRunning", "Loop")
"""Those that run although their child has ended, and say nothing of it in `repeats`."""
A_LONG_TIME = 10_000.0


class Puppet(Behaviour):
    """A child that answers what the test wants.

    Args:
        name: Its name.
    """

    answer = Status.SUCCESS
    ticks = 0

    def __init__(self, name: str) -> None:
        super().__init__(name)

    def update(self) -> Status:
        Puppet.ticks += 1
        return Puppet.answer


REGISTRY = Registry(
    [
        *default_registry().specs(),
        NodeSpec("Puppet", Puppet, Kind.ACTION, frozenset({"SUCCESS", "FAILURE", "RUNNING"})),
        NodeSpec("SkippingPuppet", Puppet, Kind.ACTION, frozenset({"SUCCESS", "SKIPPED"})),
    ]
)


class Stage:
    """A decorator around a puppet that always answers the same, with a clock that is moved by hand."""

    def __init__(self, form, answer: int) -> None:
        leaf = "SkippingPuppet" if answer == K else "Puppet"
        self.binding = bind_main(forest(form.text([f"<{leaf}/>"])), REGISTRY)
        self.clock = ManualClock()
        compiled = compile_tree(self.binding, {Clock: self.clock}, {})
        self.root = compiled.root
        self.root.setup_with_descendants()
        Puppet.answer, Puppet.ticks = STATUSES[answer], 0

    @property
    def bound(self):
        return self.binding.main.root

    def tick(self) -> tuple[int, int]:
        """Return what the decorator answers, and how often it has ticked the child."""
        before = Puppet.ticks
        for _ in self.root.tick():
            pass
        return K if was_skipped(self.root) else bit_of(self.root.status), Puppet.ticks - before

    def until_it_ends(self) -> Iterator[tuple[int, int]]:
        """Yield the result of every tick, with much time between them, until it does not run any more."""
        for _ in range(TICKS):
            answered, ticks = self.tick()
            yield answered, ticks
            if answered != R:
                break
            self.clock.advance(A_LONG_TIME)

    @property
    def is_done_at_once(self) -> bool:
        """Whether there are to be no rounds at all."""
        rounds = self.bound.spec.semantics.rounds
        return rounds is not None and rounds(self.bound) == 0


def stage_of(form, answer: int) -> Stage | None:
    """Return a stage; None for py_trees' own decorators around what is skipped, which they take for an interruption."""
    try:
        return Stage(form, answer)
    except TreeError:
        assert answer == K, form
        return None


def stages(tag: str, results=RESULTS):
    """Yield every way to write a decorator, around a child that gives one answer."""
    for form in FORMS:
        if form.spec is not SPECS[tag]:
            continue
        for answer in results:
            if (stage := stage_of(form, answer)) is not None:
                yield answer, stage


def semantics_of(tag: str):
    return SPECS[tag].semantics


@pytest.mark.parametrize("tag", SPECS)
def test_a_steady_decorator_and_no_other_ends_only_when_it_has_ticked_its_child(tag):
    unticked = [
        answered
        for _, stage in stages(tag)
        for answered, ticks in [stage.tick() for _ in range(TICKS)]
        if answered != R and not ticks and not stage.is_done_at_once
    ]
    assert semantics_of(tag).steady is (unticked == [])


@pytest.mark.parametrize("tag", [tag for tag in SPECS if semantics_of(tag).steady and tag != "Condition"])
def test_what_a_steady_decorator_changes_is_what_it_does_not_pass_on(tag):
    """Condition passes on nothing: it says whether an answer was the one it waits for."""
    changed = 0
    for answer, stage in stages(tag):
        is_begun = False
        for answered, ticks in stage.until_it_ends():
            is_begun = is_begun or ticks > 0
            changed |= answer if is_begun and answered != answer else 0
    # Whether what is skipped is passed on is the business of the outcome sets.
    assert changed & ~K == semantics_of(tag).changes & ~K


@pytest.mark.parametrize("tag", [tag for tag in SPECS if semantics_of(tag).rounds is not None])
def test_a_decorator_that_counts_begins_again_after_one_end_as_often_as_it_says(tag):
    means = semantics_of(tag)
    for answer, stage in stages(tag, (S, F)):
        begun = sum(ticks for _, ticks in stage.until_it_ends())
        rounds = means.rounds(stage.bound)
        wanted = min(rounds, TICKS) if answer == means.repeats else min(rounds, 1)
        assert begun == wanted, stage.bound.element.attributes


@pytest.mark.parametrize("tag", [tag for tag in SPECS if not tag.startswith(RUN_ON)])
def test_whoever_begins_its_child_again_after_an_end_says_so_and_counts(tag):
    means = semantics_of(tag)
    again = 0
    for answer, stage in stages(tag, (S, F)):
        again |= answer if sum(ticks for _, ticks in stage.until_it_ends()) > 1 else 0
    assert again == means.repeats
    assert (means.rounds is None) is (not again or tag == "KeepRunningUntilFailure")


@pytest.mark.parametrize("tag", SPECS)
def test_what_is_done_once_is_done_once_in_the_whole_run(tag):
    most = max(sum(stage.tick()[1] for _ in range(TICKS)) for _, stage in stages(tag, (S,)))
    assert semantics_of(tag).once is (most == 1)


@pytest.mark.parametrize("tag", SPECS)
def test_a_child_may_run_as_long_as_its_limit_says_and_no_longer(tag):
    for _, stage in stages(tag, (R,)):
        limit = semantics_of(tag).limit_sec
        seconds = math.inf if limit is None else limit(stage.bound)
        first, _ = stage.tick()
        if semantics_of(tag).changes == R and limit is None:
            assert first != R
        elif first == R:
            stage.clock.advance(min(seconds * 0.9, A_LONG_TIME))
            assert stage.tick()[0] == R
            stage.clock.advance(min(seconds * 0.2, A_LONG_TIME))
            assert (stage.tick()[0] == R) is (seconds == math.inf)
        else:
            assert limit is None or seconds <= 0
