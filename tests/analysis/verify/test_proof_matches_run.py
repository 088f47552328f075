"""Tests that proof and run agree: below every node, every other node behaves in a run as in the proof.

A run has random outcomes. The proof follows it: among the ticks that it knows of its states, it takes those
with the same events and the same outcome, once with states that forget how nodes have ended, and once with
states that do not.
"""

import functools
import itertools
import random
from typing import Any

import pytest

from sar_compiler.analysis.simulated_tree import compile_simulated
from sar_compiler.analysis.verify.properties import without_properties
from sar_compiler.analysis.verify.state import PreparedTree
from sar_compiler.analysis.verify.stepping import TreeStepper
from sar_compiler.compiler import bind_main
from sar_compiler.runtime.events import TICKED
from sar_compiler.runtime.kernel.cells import WORDS
from sar_compiler.runtime.kernel.live import LiveTree
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.tree.diagnostic import TreeError
from tests.checks.outcome_oracle import REGISTRY, leaf
from tests.node_forms import Form, forms, reads_keys
from tests.random_inputs import TIMES
from tests.trees import forest

pytestmark = pytest.mark.unmeasured

TICKS = 8
_KEYS = ("v", "entry", "item")
_PAUSES = (0.0, 0.001, 1.0, 1000.0)
_ACTS = ("SUCCESS", "FAILURE", "RUNNING")
_LEAVES = (
    '<StatusQueue queue="RUNNING;SUCCESS;FAILURE"/>',
    '<StatusQueue queue="RUNNING;FAILURE" eventually="SUCCESS"/>',
    '<Periodic n="1"/>',
    '<SuccessEveryN n="2"/>',
    '<TickCounter duration="1" completion_status="FAILURE"/>',
    '<Sleep msec="5"/>',
    '<Timer duration="0.5"/>',
    '<WasEntryUpdated entry="{entry}"/>',
    '<Script code="v = v == 0 ? 1 : 0"/>',
)


def distinct_forms(known: list[Form]) -> list[Form]:
    """Return forms with different behaviour: one world condition of Nav2, one loop, the smallest switch."""
    booleans = ("True", "False")
    return [
        form
        for form in known
        if not any(text in booleans for _, text in form.attributes)
        and not (form.spec.has_world_leaf and form.attributes)
        and form.spec.tag not in ("LoopDouble", "LoopBool", "LoopString")
        and not (form.spec.tag.startswith("Switch") and form.spec.child_count != (3, 3))
    ]


FORMS = distinct_forms(forms(REGISTRY))
FORM_BY_TAG = {form.spec.tag: form for form in reversed(FORMS)}


def stub(answers: tuple[str, ...], name: str, *, writes: bool) -> str:
    """Return a leaf, with scripts that write the keys of the node around it if `writes` is set."""
    scripts = '_onSuccess="v = v == 0 ? 1 : 0" _onFailure="entry = entry + 1"'
    return leaf(answers, name).replace("/>", f" {scripts}/>") if writes else leaf(answers, name)


def trees(around: Form, answers: tuple[str, ...]):
    """Yield a tree for each node and built-in leaf: the last child if leaves never skip, else the first."""
    known: tuple[Form | str, ...] = (*FORMS, *_LEAVES)
    for within in known:
        writes = around.reads_keys or reads_keys(str(within))
        grown = functools.partial(stub, answers, writes=writes)
        inner = (
            within
            if isinstance(within, str)
            else within.text([grown(f"c{n}") for n in range(within.count(2))])
        )
        beside = [grown(f"p{n}") for n in range(1, around.count(2))]
        yield around.text([*beside, inner] if answers is _ACTS else [inner, *beside])


def bind_or_none(body: str):
    try:
        return bind_main(forest(body), REGISTRY)
    except TreeError:
        return None


def compile_with_stubs(binding: Any) -> Any:
    """Compile a tree with stub leaves; its keys are 0 at first."""
    made = compile_simulated(binding, {})
    for key in _KEYS:
        made.compiled.instance.scope.resolve(key).write(0)
    return made


def without_ticked_events(events: Any) -> tuple[Any, ...]:
    return tuple(event for event in events if event.what != TICKED)


class RandomRun:
    """A tree that is ticked as in a run, or by py_trees alone.

    Args:
        binding: The tree.
        seed: The seed of the outcomes.
    """

    def __init__(self, binding: Any, seed: int) -> None:
        self._draw = random.Random(seed)  # noqa: S311 - the same in every run
        self._simulated = compile_with_stubs(binding)
        self._simulated.policy = self
        self._live = LiveTree(self._simulated.root) if seed % 2 else None

    def choose(self, leaf, options):
        return self._draw.choice(options)

    def tick(self):
        self._simulated.clock.advance(self._draw.choice(_PAUSES))
        self._simulated.events.clear()
        try:
            outcome = self._outcome()
        except Exception as error:  # noqa: BLE001 - compared with what the proof raises
            outcome = f"{type(error).__name__}: {error}"
        return without_ticked_events(self._simulated.events), outcome

    def _outcome(self) -> str:
        if self._live is not None:
            return WORDS[self._live.tick()]
        root = self._simulated.root
        root.tick_once()
        return "SKIPPED" if was_skipped(root) else root.status.name


class Proof:
    """The states that a proof may have reached beside a run.

    Args:
        binding: The tree.
        forgets: Whether the states forget how nodes have ended.
    """

    def __init__(self, binding: Any, *, forgets: bool) -> None:
        prepared = PreparedTree.prepare(compile_with_stubs(binding))
        # Equivalent ticks are played separately, because their events differ.
        self._stepper = TreeStepper(prepared, without_properties().rules, forgets=forgets, meets=False)
        self._states: set[Any] = {self._stepper.steps.start()}

    def follow(self, seen) -> list[Any]:
        """Follow the ticks that match the last tick of the run; return all ticks if none matches."""
        events, outcome = seen
        # The outcome excludes most ticks, at less cost than their events.
        found = {
            tick.state
            for tick in self._ticks()
            if self._outcome(tick) == outcome and self._events() == events
        }
        if not found:
            return [(self._events(), self._outcome(tick)) for tick in self._ticks()]
        self._states = found
        return []

    def _ticks(self):
        return (tick for state in self._states for tick in self._stepper.ticks(state))

    def _events(self) -> tuple[Any, ...]:
        """Return the events of the last tick."""
        return without_ticked_events(self._stepper.tick_record().events)

    def _outcome(self, tick) -> str:
        return WORDS[tick.outcome] if tick.error is None else f"{type(tick.error).__name__}: {tick.error}"


def difference(body: str, binding: Any, seed: int) -> str:
    """Return the first difference between a run and its proof; empty if there is none."""
    run = RandomRun(binding, seed)
    proofs = {forgets: Proof(binding, forgets=forgets) for forgets in (True, False)}
    for number, (forgets, proof) in itertools.product(range(TICKS), proofs.items()):
        if forgets:
            seen = run.tick()
        possible = proof.follow(seen)
        if possible:
            return f"{body}, seed {seed}, tick {number}, forgets={forgets}: {seen}, where only {possible} is known"
        if not seen[1].isupper() and not forgets:
            break
    return ""


@pytest.mark.parametrize("around", FORM_BY_TAG.values(), ids=str)
def test_every_node_behaves_in_run_as_in_proof(around):
    compared, place = 0, list(FORM_BY_TAG).index(around.spec.tag)
    for seed, answers in enumerate((_ACTS, (*_ACTS, "SKIPPED"))):
        for number, body in enumerate(trees(around, answers)):
            # Every pair of nodes runs with one of the two sets of outcomes, and with both if more is tested.
            binding = bind_or_none(body) if TIMES > 1 or (number + seed + place) % 2 else None
            if binding is not None:
                assert difference(body, binding, compared + seed) == ""
                compared += 1
    assert compared > len(FORMS) // 4
