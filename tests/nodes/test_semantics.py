"""Tests that the semantics of decorators in their specs match their behaviour."""

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
"""Decorators that keep running after their child has ended, without declaring it in `repeats`."""
A_LONG_TIME = 10_000.0


class Puppet(Behaviour):
    """A child that returns the status that the test sets.

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
    """A decorator around a puppet that always returns the same status, with a manual clock."""

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
        """Tick the decorator, and return its outcome and the number of ticks of the child."""
        before = Puppet.ticks
        for _ in self.root.tick():
            pass
        return K if was_skipped(self.root) else bit_of(self.root.status), Puppet.ticks - before

    def until_it_ends(self) -> Iterator[tuple[int, int]]:
        """Yield the result of every tick, with a long time between them, until the decorator has ended."""
        for _ in range(TICKS):
            answered, ticks = self.tick()
            yield answered, ticks
            if answered != R:
                break
            self.clock.advance(A_LONG_TIME)

    @property
    def is_done_at_once(self) -> bool:
        """Whether the declared number of rounds is zero."""
        rounds = self.bound.spec.semantics.rounds
        return rounds is not None and rounds(self.bound) == 0


def stage_of(form, answer: int) -> Stage | None:
    """Return a stage, or None for a decorator of py_trees with a skipped child, which it would treat as interrupted."""
    try:
        return Stage(form, answer)
    except TreeError:
        assert answer == K, form
        return None


def stages(tag: str, results=RESULTS):
    """Yield a stage for every form of a decorator and every status of its child."""
    for form in FORMS:
        if form.spec is not SPECS[tag]:
            continue
        for answer in results:
            if (stage := stage_of(form, answer)) is not None:
                yield answer, stage


def semantics_of(tag: str):
    return SPECS[tag].semantics


@pytest.mark.parametrize("tag", SPECS)
def test_decorator_is_steady_if_it_ends_only_after_ticking_child(tag):
    unticked = [
        answered
        for _, stage in stages(tag)
        for answered, ticks in [stage.tick() for _ in range(TICKS)]
        if answered != R and not ticks and not stage.is_done_at_once
    ]
    assert semantics_of(tag).steady is (unticked == [])


@pytest.mark.parametrize("tag", [tag for tag in SPECS if semantics_of(tag).steady and tag != "Condition"])
def test_changes_of_steady_decorator_are_outcomes_that_it_does_not_return(tag):
    """Condition is left out, because it does not return its child's outcome, but whether it is the expected one."""
    changed = 0
    for answer, stage in stages(tag):
        is_begun = False
        for answered, ticks in stage.until_it_ends():
            is_begun = is_begun or ticks > 0
            changed |= answer if is_begun and answered != answer else 0
    # The outcome sets define whether a skip is passed on.
    assert changed & ~K == semantics_of(tag).changes & ~K


@pytest.mark.parametrize("tag", [tag for tag in SPECS if semantics_of(tag).rounds is not None])
def test_counting_decorator_starts_child_as_often_as_declared(tag):
    means = semantics_of(tag)
    for answer, stage in stages(tag, (S, F)):
        begun = sum(ticks for _, ticks in stage.until_it_ends())
        rounds = means.rounds(stage.bound)
        wanted = min(rounds, TICKS) if answer == means.repeats else min(rounds, 1)
        assert begun == wanted, stage.bound.element.attributes


@pytest.mark.parametrize("tag", [tag for tag in SPECS if not tag.startswith(RUN_ON)])
def test_decorator_that_restarts_ended_child_declares_it_and_counts(tag):
    means = semantics_of(tag)
    again = 0
    for answer, stage in stages(tag, (S, F)):
        again |= answer if sum(ticks for _, ticks in stage.until_it_ends()) > 1 else 0
    assert again == means.repeats
    assert (means.rounds is None) is (not again or tag == "KeepRunningUntilFailure")


@pytest.mark.parametrize("tag", SPECS)
def test_decorator_is_once_if_it_executes_child_only_once_in_run(tag):
    most = max(sum(stage.tick()[1] for _ in range(TICKS)) for _, stage in stages(tag, (S,)))
    assert semantics_of(tag).once is (most == 1)


@pytest.mark.parametrize("tag", SPECS)
def test_child_may_run_until_declared_time_limit_and_no_longer(tag):
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
