"""The result of verifying a tree, as text and as JSON."""

import json
import textwrap
from collections.abc import Iterator, Mapping

from sar_compiler.checks.verify.traces import Trace, TraceTick, ValueChange
from sar_compiler.checks.verify.verdicts import Verdict, Verification
from sar_compiler.runtime.stub_leaf import ANSWERED, HALTED, Event, StubLeaf
from sar_compiler.views.plain import plain
from sar_compiler.views.trace import leaf_labels

_WIDTH = 110


def verification_as_text(verification: Verification, seconds: float) -> str:
    """Return the results: the counterexamples, and a line for each property.

    Args:
        verification: The results.
        seconds: The duration of the verification, in seconds.
    """
    labels = leaf_labels(verification.leaves)
    told = [
        line
        for verdict in verification.verdicts
        if verdict.trace
        for line in _told(verdict, verdict.trace, labels)
    ]
    return "\n".join([*told, *_summary(verification, seconds)])


def verification_as_json(verification: Verification, seconds: float) -> str:
    """Return the results as a JSON object; see `verification_as_text`."""
    data = {
        "proved": verification.proved,
        "states": verification.states,
        "ticks": verification.ticks,
        "depth": verification.depth,
        "complete": verification.complete,
        "stopped": verification.stopped,
        "seconds": round(seconds, 3),
        "questions": [_as_dict(verdict) for verdict in verification.verdicts],
        "left_out": [
            {"property": each.name, "missing": list(each.missing)} for each in verification.left_out
        ],
    }
    return json.dumps(data, indent=2, ensure_ascii=False)


def _told(verdict: Verdict, trace: Trace, labels: Mapping[StubLeaf, str]) -> Iterator[str]:
    yield f"{verdict.question}: {verdict.outcome.value}"
    yield f"  {verdict.reason}:"
    first = len(trace.ticks) - trace.loop
    for number, tick in enumerate(trace.ticks):
        if number == first:
            yield "  from here on for ever:"
        yield from _tick_lines(number + 1, tick, labels)
    yield ""


def _tick_lines(number: int, tick: TraceTick, labels: Mapping[StubLeaf, str]) -> Iterator[str]:
    label = f"{number:5}  "
    seen = [event for event in tick.events if event.what in (ANSWERED, HALTED)]
    done = [f"{labels[e.leaf]} {e.what if e.answer is None else e.answer.name}" for e in seen]
    came_to = [f"root {tick.root}"] if tick.root else []
    changes = [f"{name}: {_value(was)} -> {_value(now)}" for name, (was, now) in tick.changes.items()]
    for line in (", ".join(done), "; ".join([*came_to, *changes]), tick.error):
        if line:
            yield from textwrap.wrap(line, _WIDTH, initial_indent=label, subsequent_indent=" " * len(label))
            label = " " * len(label)


def _value(value: object) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)


def _summary(verification: Verification, seconds: float) -> Iterator[str]:
    verdicts = verification.verdicts
    width = max(len(verdict.question) for verdict in verdicts) + 2
    states = _counted(verification.states, "state")
    ticks, depth = (_counted(number, "tick") for number in (verification.ticks, verification.depth))
    yield f"{states}, {ticks} between them, {depth} deep, {seconds:.1f} s"
    for verdict in verdicts:
        line = f"  {verdict.question + ':':{width}}{verdict.outcome.value}"
        yield line if verdict.trace or not verdict.reason else f"{line}: {verdict.reason}"
    for left in verification.left_out:
        yield f"  {left.name + ':':{width}}left out: this tree has no {', no '.join(left.missing)}"
    if not verification.complete:
        yield from _bound(verification)


def _counted(number: int, word: str) -> str:
    return f"{number:,} {word}{'' if number == 1 else 's'}"


def _bound(verification: Verification) -> Iterator[str]:
    how = "it was stopped there" if verification.stopped else "--max-states says how many are looked at"
    yield f"Not proved beyond {_counted(verification.states, 'state')}: there are more; {how}."
    if verification.growing:
        listed = ", ".join(f"{name} ({count})" for name, count in verification.growing)
        yield f"Most different values among the last ones had: {listed}."


def _as_dict(verdict: Verdict) -> dict[str, object]:
    return {
        "question": verdict.question,
        "verdict": verdict.outcome.value,
        "reason": verdict.reason,
        "trace": None if verdict.trace is None else _trace(verdict.trace),
    }


def _trace(trace: Trace) -> dict[str, object]:
    return {"ticks": [_tick(tick) for tick in trace.ticks], "loop": trace.loop}


def _tick(tick: TraceTick) -> dict[str, object]:
    return {
        "events": [_event(event) for event in tick.events],
        "root": tick.root,
        "changes": _changes(tick.changes),
        "error": tick.error,
    }


def _event(event: Event) -> dict[str, object]:
    told: dict[str, object] = {"leaf": event.leaf.name, "path": "/".join(event.leaf.path), "what": event.what}
    if event.answer is not None:
        told |= {"status": event.answer.status, "label": event.answer.label}
    return told


def _changes(changes: Mapping[str, ValueChange]) -> dict[str, list[object]]:
    return {name: [plain(before), plain(after)] for name, (before, after) in changes.items()}
