"""The result of verifying a tree, as text and as JSON, and its states as PRISM's explicit files.

PRISM, Storm or a program of one's own give a second opinion. A tick is a choice of a Markov decision process there, with one
outcome of probability 1.
"""

import re
import textwrap
from array import array
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import NamedTuple

from sar_compiler.analysis.trace_view import leaf_labels
from sar_compiler.analysis.verify.state_space import StateSpace, Trace
from sar_compiler.analysis.verify.verdicts import (
    BETTER,
    OTHER,
    SAME,
    WORSE,
    ProofStatus,
    Verdict,
    Verification,
    VerificationComparison,
)
from sar_compiler.runtime.events import ANSWERED, HALTED, TICKED, Event, TickRecord
from sar_compiler.tree.plain import as_json, count_text, plain, value_as_script

_WIDTH = 110


def verification_as_text(verification: Verification, seconds: float) -> str:
    """Return the results: a line for each property, and then the counterexamples.

    Args:
        verification: The results.
        seconds: The duration of the verification, in seconds.
    """
    labels = leaf_labels(verification.leaves)
    told = [
        line
        for verdict in verification.verdicts
        if verdict.trace
        for line in _trace_lines(verdict, verdict.trace, labels)
    ]
    return "\n".join([*_summary(verification, seconds), *told])


def verification_as_json(verification: Verification, seconds: float) -> str:
    """Return the results as a JSON object; see `verification_as_text`."""
    return as_json({**verification_data(verification), "seconds": round(seconds, 3)})


def verification_data(verification: Verification) -> dict[str, object]:
    """Return the results as data for JSON."""
    return {
        "proved": verification.proved,
        **_numbers(verification),
        "questions": [
            {"question": verdict.question, **_as_dict(verdict)} for verdict in verification.verdicts
        ],
        "left_out": [
            {"property": each.name, "missing": list(each.missing)} for each in verification.left_out
        ],
    }


def comparison_as_text(comparison: VerificationComparison, names: tuple[str, str], seconds: float) -> str:
    """Return how the answers have changed: a line for each question, and then a run for each that is worse.

    Args:
        comparison: The answers.
        names: What the trees are called, the one before and the one now.
        seconds: The duration of both verifications, in seconds.
    """
    labels = leaf_labels(comparison.now.leaves)
    told = [
        line
        for answer in comparison.answers
        if answer.change == WORSE and answer.now and answer.now.trace
        for line in _trace_lines(answer.now, answer.now.trace, labels)
    ]
    return "\n".join([*_changes_in(comparison, names, seconds), *told])


def comparison_as_json(comparison: VerificationComparison, names: tuple[str, str], seconds: float) -> str:
    """Return how the answers have changed as a JSON object; see `comparison_as_text`."""
    sides = zip(("before", "now"), names, (comparison.before, comparison.now), strict=True)
    data = {
        "worse": comparison.worse,
        "seconds": round(seconds, 3),
        **{side: {"file": name, **_numbers(verification)} for side, name, verification in sides},
        "questions": [
            {
                "question": answer.question,
                "change": answer.change,
                "before": answer.before and _as_dict(answer.before),
                "now": answer.now and _as_dict(answer.now),
            }
            for answer in comparison.answers
        ],
    }
    return as_json(data)


def _changes_in(comparison: VerificationComparison, names: tuple[str, str], seconds: float) -> Iterator[str]:
    answers, sides = comparison.answers, (comparison.before, comparison.now)
    named = max(map(len, names)) + 2
    for name, side, when in zip(names, sides, ("before", "now"), strict=True):
        size = f"{count_text(side.states, 'state')}, {count_text(side.steps, 'step')} between them"
        yield f"{when + ':':8}{name:{named}}{size}"
    counts = Counter(answer.change for answer in answers)
    listed = ", ".join(
        f"{counts[change]} {change}" for change in (WORSE, BETTER, OTHER, SAME) if counts[change]
    )
    yield f"{count_text(len(answers), 'answer')}: {listed}; {seconds:.1f} s"
    width = max(len(answer.question) for answer in answers) + 2
    for answer in answers:
        line = f"  {answer.question + ':':{width}}{_answer_or_none(answer.now)}"
        changed = answer.change != SAME
        yield f"{line}; before: {_answer_or_none(answer.before)}" if changed else line
    for name, side in zip(names, sides, strict=True):
        yield from (f"{name}: {line}" for line in _limits(side))


def _answer_or_none(verdict: Verdict | None) -> str:
    return "left out" if verdict is None else _answer(verdict)


def _trace_lines(verdict: Verdict, trace: Trace, labels: Mapping[int, str]) -> Iterator[str]:
    yield ""
    yield f"{verdict.question}: {verdict.outcome.value}"
    yield f"  {verdict.reason}:"
    first = len(trace.ticks) - trace.loop
    for number, tick in enumerate(trace.ticks):
        if number == first:
            yield "  from here on for ever:"
        yield from _tick_lines(number + 1, tick, labels)


def _tick_lines(number: int, tick: TickRecord, labels: Mapping[int, str]) -> Iterator[str]:
    label = f"{number:5}  "
    seen = [event for event in tick.events if event.what in (ANSWERED, HALTED)]
    done = [f"{labels[event.number]} {event.deed}" for event in seen]
    came_to = [f"root {tick.root}"] if tick.root else []
    values = {**tick.keys, **tick.facts}
    changes = [
        f"{name}: {value_as_script(was)} -> {value_as_script(now)}" for name, (was, now) in values.items()
    ]
    for line in (", ".join(done), "; ".join([*came_to, *changes]), tick.error):
        if line:
            yield from textwrap.wrap(line, _WIDTH, initial_indent=label, subsequent_indent=" " * len(label))
            label = " " * len(label)


def _summary(verification: Verification, seconds: float) -> Iterator[str]:
    verdicts = verification.verdicts
    width = max(len(verdict.question) for verdict in verdicts) + 2
    states = count_text(verification.states, "state")
    steps, depth = count_text(verification.steps, "step"), count_text(verification.depth, "tick")
    yield f"{states}, {steps} between them, {depth} deep, {seconds:.1f} s"
    yield _tally(verification)
    for verdict in verdicts:
        yield f"  {verdict.question + ':':{width}}{_answer(verdict)}"
    for left in verification.left_out:
        yield f"  {left.name + ':':{width}}left out: this tree has no {', no '.join(left.missing)}"
    yield from _limits(verification)


def _tally(verification: Verification) -> str:
    """Return how many answers there are of each kind."""
    counts = Counter(verdict.outcome for verdict in verification.verdicts)
    broken = "does not hold" if counts[ProofStatus.BROKEN] == 1 else "do not hold"
    kinds = [
        (counts[ProofStatus.PROVED], "proved"),
        (counts[ProofStatus.BROKEN], broken),
        (counts[ProofStatus.UNDECIDED], "not decided"),
        (len(verification.left_out), "left out"),
    ]
    listed = ", ".join(f"{count} {kind}" for count, kind in kinds if count)
    return f"{count_text(sum(count for count, _ in kinds), 'answer')}: {listed}"


def _answer(verdict: Verdict) -> str:
    """Return an answer, with what no run shows."""
    shown = verdict.trace is not None or not verdict.reason
    return verdict.outcome.value if shown else f"{verdict.outcome.value}: {verdict.reason}"


def _limits(verification: Verification) -> Iterator[str]:
    """Yield how the answers were found, and of what there is no proof."""
    if verification.branches:
        yield f"{verification.branches} parallel branches share nothing, and were searched apart: {verification.searches} searches."
    for tag, cls in verification.by_semantics:
        yield f"<{tag}> ({cls}) was taken to do what its semantics say; of its own methods nothing is proved."
    if verification.complete:
        return
    how = "it was stopped there" if verification.stopped else "--max-states says how many are looked at"
    yield f"Not proved beyond {count_text(verification.states, 'state')}: there are more; {how}."
    if verification.growing:
        listed = ", ".join(f"{name} ({count})" for name, count in verification.growing)
        yield f"Most different values among the last ones had: {listed}."


def _numbers(verification: Verification) -> dict[str, object]:
    return {
        "states": verification.states,
        "steps": verification.steps,
        "depth": verification.depth,
        "complete": verification.complete,
        "stopped": verification.stopped,
        "searches": verification.searches,
        "branches": verification.branches,
        "by_semantics": [{"tag": tag, "class": cls} for tag, cls in verification.by_semantics],
    }


def _as_dict(verdict: Verdict) -> dict[str, object]:
    return {
        "verdict": verdict.outcome.value,
        "reason": verdict.reason,
        "trace": None if verdict.trace is None else _trace(verdict.trace),
    }


def _trace(trace: Trace) -> dict[str, object]:
    return {"ticks": [_tick(tick) for tick in trace.ticks], "loop": trace.loop}


def _tick(tick: TickRecord) -> dict[str, object]:
    return {
        "events": [_event(event) for event in tick.events if event.what != TICKED],
        "root": tick.root,
        "changes": {
            name: [plain(before), plain(after)]
            for name, (before, after) in {**tick.keys, **tick.facts}.items()
        },
        "error": tick.error,
    }


def _event(event: Event) -> dict[str, object]:
    told: dict[str, object] = {"leaf": event.leaf, "path": "/".join(event.path), "what": event.what}
    if event.what == ANSWERED:
        told |= {"status": event.status, "label": event.label}
    return told


# What a name in PRISM's language cannot be.
_RESERVED = (
    "A bool clock const ctmc C double dtmc E endinit endinvariant endmodule endobservables endrewards endsystem "
    "false filter formula func F global G I init int invariant label max mdp min module nondeterministic "
    "observable observables of P Pmax Pmin pomdp popta prob probabilistic pta R rate rewards Rmax Rmin S "
    "stochastic system true U W X"
)
_NOTHING = value_as_script(None)
_INTEGER = re.compile(r"-?\d{1,9}")


class Variable(NamedTuple):
    """A fact or a key of the tree, as a column of the file of states.

    Attributes:
        name: What it is called there.
        source: The fact or the key.
        codes: The number of each of its values, which are texts as in a script; empty if these stand there themselves.
    """

    name: str
    source: str
    codes: Mapping[str, int]

    def shown(self, value: str) -> str:
        """Return the number or text that encodes a value."""
        return str(self.codes[value]) if self.codes else value


class PrismModel:
    """A state space in PRISM's explicit form.

    Args:
        space: The states and ticks.

    Attributes:
        variables: The facts and keys. `state` stands before them, a state's own number.
    """

    def __init__(self, space: StateSpace) -> None:
        self._space = space
        self._graph = space.graph
        self._count = len(space.graph.states)
        # Few rows are different: what else a state has is which nodes are running.
        rows: dict[tuple[tuple[str, str], ...], int] = {}
        self._row = array("I", (rows.setdefault(self._values(n), len(rows)) for n in range(self._count)))
        self._rows = [dict(row) for row in rows]
        names, take = dict.fromkeys(name for row in self._rows for name in row), _identifiers({"state"})
        self.variables = tuple(Variable(take(name), name, self._codes(name)) for name in names)

    def _values(self, state: int) -> tuple[tuple[str, str], ...]:
        values = self._space.values(state).items()
        return tuple((name, value_as_script(plain(value))) for name, value in values)

    def _codes(self, name: str) -> dict[str, int]:
        """Return the numbers of a column's values; none if all are truth values, or all whole numbers."""
        values = dict.fromkeys(row.get(name, _NOTHING) for row in self._rows)
        if values.keys() <= {"true", "false"} or all(_INTEGER.fullmatch(value) for value in values):
            return {}
        return {value: number for number, value in enumerate(values)}

    def states(self) -> Iterator[str]:
        """Yield the lines of the file of states, `.sta`."""
        yield f"({','.join(['state', *(variable.name for variable in self.variables)])})\n"
        rows = [
            "".join(f",{each.shown(row.get(each.source, _NOTHING))}" for each in self.variables)
            for row in self._rows
        ]
        yield from (f"{state}:({state}{rows[row]})\n" for state, row in enumerate(self._row))

    def transitions(self) -> Iterator[str]:
        """Yield the lines of the file of transitions, `.tra`, with what leaves answer as the action; a state without ticks has one to itself."""
        graph, labels = self._graph, leaf_labels(self._space.stepper.leaves)
        count = sum(len(graph.ticks(state)) or 1 for state in range(self._count))
        yield f"{self._count} {count} {count}\n"
        take, actions = _identifiers(()), dict[str, str]()
        for state in range(self._count):
            ticks = zip(graph.ticks(state), self._space.answers(state), strict=True)
            told = [
                (target, "  ".join(f"{labels[each.number]} {each.deed}" for each in answers) or "tick")
                for (target, _), answers in ticks
            ]
            for choice, (target, text) in enumerate(told or [(state, "nothing")]):
                action = actions.get(text) or actions.setdefault(text, take(text))
                yield f"{state} {choice} {target} 1 {action}\n"

    def labels(self) -> Iterator[str]:
        """Yield the lines of the file of labels, `.lab`."""
        labels = self._labels()
        yield " ".join(f'{number}="{name}"' for number, name in enumerate(labels)) + "\n"
        for state in range(self._count):
            numbers = [str(number) for number, holds in enumerate(labels.values()) if holds(state)]
            if numbers:
                yield f"{state}: {' '.join(numbers)}\n"

    def _labels(self) -> dict[str, Callable[[int], bool]]:
        """Return what says whether a state has a label, for each."""
        graph, take = self._graph, _identifiers(())
        labels: dict[str, Callable[[int], bool]] = {
            "init": lambda state: state == 0,
            "deadlock": lambda state: not graph.ticks(state),
            "end": lambda state: bool(graph.ends[state]),
            "unexplored": lambda state: state >= graph.expanded,
            "error": lambda state: graph.error is not None and graph.error.source == state,
        }
        for rule, name in enumerate(self._space.rules):
            slug = take(name)
            breach = graph.breaches.get(rule)
            labels[f"breaks_{slug}"] = _is_state(None if breach is None else breach.source)
            if rule in self._space.owing:
                labels[f"owes_{slug}"] = self._owes(1 << rule)
        return labels

    def _owes(self, debt: int) -> Callable[[int], bool]:
        return lambda state: bool(self._graph.pending[state] & debt)


def _is_state(number: int | None) -> Callable[[int], bool]:
    return lambda state: state == number


def _identifiers(taken: Collection[str]) -> Callable[[str], str]:
    """Return what makes different identifiers of PRISM's language of names."""
    known = {*taken, *_RESERVED.split()}

    def take(name: str) -> str:
        plain_name = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "_"
        first = f"_{plain_name}" if plain_name[0].isdigit() else plain_name
        identifier, number = first, 2
        while identifier in known:
            identifier, number = f"{first}_{number}", number + 1
        known.add(identifier)
        return identifier

    return take
