"""Displays the results of verifications as text or as JSON."""

import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping

from sar_compiler.analysis.merging import merging_notes
from sar_compiler.analysis.trace_view import leaf_labels
from sar_compiler.analysis.verify.state_space import Trace
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
from sar_compiler.runtime.events import HALTED, RETURNED, TICKED, Event, TickRecord
from sar_compiler.tree.plain import as_json, count_with_noun, to_json_value, value_as_script

_WIDTH = 110


def verification_as_text(verification: Verification, seconds: float) -> str:
    """Return the results of a verification as text: one line for each property, then the counterexamples.

    Args:
        verification: The verification.
        seconds: The duration of the verification, in seconds.
    """
    labels = leaf_labels(verification.leaves)
    traces = [
        line
        for verdict in verification.verdicts
        if verdict.trace
        for line in _trace_lines(verdict, verdict.trace, labels)
    ]
    return "\n".join([*_summary(verification, seconds), *traces])


def verification_as_json(verification: Verification, seconds: float) -> str:
    """Return the results of a verification as JSON. The arguments are those of `verification_as_text`."""
    return as_json({**verification_data(verification), "seconds": round(seconds, 3)})


def verification_data(verification: Verification) -> dict[str, object]:
    """Return the results of a verification as data that can be written as JSON."""
    return {
        "proved": verification.is_proved,
        **_search_data(verification),
        "questions": [
            {"question": verdict.question, **_as_dict(verdict)} for verdict in verification.verdicts
        ],
        "left_out": [
            {"property": each.name, "missing": list(each.missing)} for each in verification.left_out
        ],
    }


def comparison_as_text(comparison: VerificationComparison, names: tuple[str, str], seconds: float) -> str:
    """Return a comparison as text: a line for each property, and counterexamples for worse results.

    Args:
        comparison: The compared verifications.
        names: The names of the previous and the present tree.
        seconds: The duration of both verifications, in seconds.
    """
    labels = leaf_labels(comparison.now.leaves)
    traces = [
        line
        for answer in comparison.verdicts
        if answer.change == WORSE and answer.now and answer.now.trace
        for line in _trace_lines(answer.now, answer.now.trace, labels)
    ]
    return "\n".join([*_changes_in(comparison, names, seconds), *traces])


def comparison_as_json(comparison: VerificationComparison, names: tuple[str, str], seconds: float) -> str:
    """Return a comparison of two verifications as JSON. The arguments are those of `comparison_as_text`."""
    sides = zip(("before", "now"), names, (comparison.before, comparison.now), strict=True)
    data = {
        "worse": comparison.is_worse,
        "seconds": round(seconds, 3),
        **{side: {"file": name, **_search_data(verification)} for side, name, verification in sides},
        "questions": [
            {
                "question": answer.question,
                "change": answer.change,
                "before": answer.before and _as_dict(answer.before),
                "now": answer.now and _as_dict(answer.now),
            }
            for answer in comparison.verdicts
        ],
    }
    return as_json(data)


def _changes_in(comparison: VerificationComparison, names: tuple[str, str], seconds: float) -> Iterator[str]:
    answers, sides = comparison.verdicts, (comparison.before, comparison.now)
    named = max(map(len, names)) + 2
    for name, side, when in zip(names, sides, ("before", "now"), strict=True):
        size = f"{count_with_noun(side.states, 'state')}, {count_with_noun(side.steps, 'step')} between them"
        yield f"{when + ':':8}{name:{named}}{size}"
    counts = Counter(answer.change for answer in answers)
    listed = ", ".join(
        f"{counts[change]} {change}" for change in (WORSE, BETTER, OTHER, SAME) if counts[change]
    )
    yield f"{count_with_noun(len(answers), 'outcome')}: {listed}; {seconds:.1f} s"
    width = max(len(answer.question) for answer in answers) + 2
    for answer in answers:
        line = f"  {answer.question + ':':{width}}{_verdict_or_left_out(answer.now)}"
        changed = answer.change != SAME
        yield f"{line}; before: {_verdict_or_left_out(answer.before)}" if changed else line
    for name, side in zip(names, sides, strict=True):
        yield from (f"{name}: {line}" for line in _limits(side))


def _verdict_or_left_out(verdict: Verdict | None) -> str:
    return "left out" if verdict is None else _verdict_text(verdict)


def _trace_lines(verdict: Verdict, trace: Trace, labels: Mapping[int, str]) -> Iterator[str]:
    yield ""
    yield f"{verdict.question}: {verdict.outcome.value}"
    yield f"  {verdict.reason}:"
    first = len(trace.ticks) - trace.loop
    for number, tick in enumerate(trace.ticks):
        if number == first:
            yield "  from here on forever:"
        yield from _tick_lines(number + 1, tick, labels)


def _tick_lines(number: int, tick: TickRecord, labels: Mapping[int, str]) -> Iterator[str]:
    label = f"{number:5}  "
    seen = [event for event in tick.events if event.what in (RETURNED, HALTED)]
    done = [f"{labels[event.number]} {event.action}" for event in seen]
    root = [f"root {tick.root}"] if tick.root else []
    values = {**tick.keys, **tick.facts}
    changes = [
        f"{name}: {value_as_script(was)} -> {value_as_script(now)}" for name, (was, now) in values.items()
    ]
    for line in (", ".join(done), "; ".join([*root, *changes]), tick.error):
        if line:
            yield from textwrap.wrap(line, _WIDTH, initial_indent=label, subsequent_indent=" " * len(label))
            label = " " * len(label)


def _summary(verification: Verification, seconds: float) -> Iterator[str]:
    verdicts = verification.verdicts
    width = max(len(verdict.question) for verdict in verdicts) + 2
    states = count_with_noun(verification.states, "state")
    steps, depth = count_with_noun(verification.steps, "step"), count_with_noun(verification.depth, "tick")
    yield f"{states}, {steps} between them, {depth} deep, {seconds:.1f} s"
    yield _count_line(verification)
    for verdict in verdicts:
        yield f"  {verdict.question + ':':{width}}{_verdict_text(verdict)}"
    for left in verification.left_out:
        yield f"  {left.name + ':':{width}}left out: this tree has no {', no '.join(left.missing)}"
    yield from _limits(verification)


def _count_line(verification: Verification) -> str:
    """Return the line that states how many properties were proved, violated, undecided or left out."""
    counts = Counter(verdict.outcome for verdict in verification.verdicts)
    broken = "does not hold" if counts[ProofStatus.BROKEN] == 1 else "do not hold"
    kinds = [
        (counts[ProofStatus.PROVED], "proved"),
        (counts[ProofStatus.BROKEN], broken),
        (counts[ProofStatus.UNDECIDED], "not decided"),
        (len(verification.left_out), "left out"),
    ]
    listed = ", ".join(f"{count} {kind}" for count, kind in kinds if count)
    return f"{count_with_noun(sum(count for count, _ in kinds), 'outcome')}: {listed}"


def _verdict_text(verdict: Verdict) -> str:
    """Return a verdict as text. Include the reason if there is no counterexample that shows this reason."""
    shown = verdict.trace is not None or not verdict.reason
    return verdict.outcome.value if shown else f"{verdict.outcome.value}: {verdict.reason}"


def _limits(verification: Verification) -> Iterator[str]:
    """Yield notes on how the search was simplified, and on the limits that it reached."""
    if verification.branches:
        yield f"{verification.branches} parallel branches share no data, so they were searched separately, in {verification.searches} searches."
    yield from merging_notes(verification.merged)
    for tag, cls in verification.by_semantics:
        yield f"<{tag}> ({cls}) was replaced by its semantics. Its own methods are not verified."
    if verification.complete:
        return
    how = "the search was stopped" if verification.stopped else "raise the limit with --max-states"
    yield f"Not proved beyond {count_with_noun(verification.states, 'state')}: there are more states ({how})."
    if verification.growing:
        listed = ", ".join(f"{name} ({count})" for name, count in verification.growing)
        yield f"The entries with the highest numbers of different values in the last states are: {listed}."


def _search_data(verification: Verification) -> dict[str, object]:
    return {
        "states": verification.states,
        "steps": verification.steps,
        "depth": verification.depth,
        "complete": verification.complete,
        "stopped": verification.stopped,
        "searches": verification.searches,
        "branches": verification.branches,
        "not_distinguished": list(merging_notes(verification.merged)),
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
            name: [to_json_value(before), to_json_value(after)]
            for name, (before, after) in {**tick.keys, **tick.facts}.items()
        },
        "error": tick.error,
    }


def _event(event: Event) -> dict[str, object]:
    data: dict[str, object] = {"leaf": event.leaf, "path": "/".join(event.path), "what": event.what}
    if event.what == RETURNED:
        data |= {"status": event.status, "label": event.label}
    return data
