"""Replays traces of BehaviorTree.CPP: `python tests/conformance/replay.py CASES.json`.

Prints one line for each case that differs, with its first difference, and last `N same, M differ`. Exit
status 0 if all differences are on the list of deviations (`tests/conformance/deviations.py`), 1 if not, 2 for
wrong usage.
"""

import dataclasses
import functools
import json
import math
import os
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

if __name__ == "__main__":
    # As a script, this has no tests folder on its path, and a habit replaces a node of the kernel, which only
    # the Python kernel permits.
    os.environ["SAR_KERNEL"] = "python"
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from sar_compiler.checks import check
from sar_compiler.compiler import bind_main, compile_tree
from sar_compiler.nodes.registry import Registry, load_registry
from sar_compiler.runtime.blackboard import Board, Scope
from sar_compiler.runtime.clock import Clock, ManualClock
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.runtime.variables import Enums
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from tests.conformance import btcpp_behaviour, leaves
from tests.conformance.deviations import Difference, deviation
from tests.conformance.leaves import Event, Events

Case = Mapping[str, Any]
Run = Mapping[str, Any]
Said = tuple[str, ...]

_ASYNC = "async"
_WORDS = {"S": "SUCCESS", "F": "FAILURE", "R": "RUNNING", "K": "SKIPPED", "X": "EXCEPTION"}
_SHORT_LEAF = re.compile(r"\b(\w)\((\w+)(\*?)\)")
_SKIPS = re.compile(r'outcomes="[^"]*K')

# A sleep takes slightly longer than requested.
_LATE_SEC = 0.0001
_USAGE = 2


@dataclass(frozen=True)
class Compiled:
    """A tree that is ready to be replayed.

    Attributes:
        root: Its root.
        board: Its entries.
        scopes: The scope of each tree instance by its path; the main tree's by its ID.
        events: The events of its leaves.
    """

    root: Behaviour
    board: Board
    scopes: Mapping[str, Scope]
    events: Events


@dataclass(frozen=True)
class Seen:
    """The result of one tick here.

    Attributes:
        root: The root's status; EXCEPTION if an error was raised.
        events: The events.
        blackboards: The entries of each tree instance.
        error: The error that was raised.
    """

    root: str
    events: list[Event]
    blackboards: Mapping[str, Mapping[str, object]]
    error: str = ""


def cases_of(path: Path) -> list[Case]:
    """Read a file of cases.

    Raises:
        OSError, ValueError, KeyError: If it is not a file of cases.
    """
    cases = json.loads(path.read_text(encoding="utf-8"))["cases"]
    return [case if "xml" in case else _written_out(case) for case in cases]


def _written_out(short: Case) -> Case:
    """Return the full form of a case that is written in short form.

    A leaf is `a(SFR)`, with a star if it begins anew with each start; a tick is `R: a=S halt b`, the root's
    outcome first.
    """
    ticks = short["ticks"]
    runs = ticks if isinstance(ticks, dict) else {"once": ticks}
    body = _SHORT_LEAF.sub(_leaf_in_full, short["tree"])
    return {
        "name": body,
        "xml": f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>',
        "ticks": max(map(len, runs.values())),
        "bb": {"place": 0},
        "modes_equal": runs is not ticks,
        "runs": [
            {"mode": mode, "ticks": [_tick_in_full(tick) for tick in ticks]} for mode, ticks in runs.items()
        ],
    }


def _leaf_in_full(match: re.Match[str]) -> str:
    leaf, answers, star = match.groups()
    restart = ' restart="true"' if star else ""
    return f'<Scripted name="{leaf}" id="{leaf}" outcomes="{",".join(answers)}"{restart}/>'


def _tick_in_full(tick: str) -> Mapping[str, Any]:
    root, _, events = tick.partition(":")
    told = re.findall(r"(halt )?(\w)(?:=(\w))?", events)
    return {
        "root": _WORDS[root],
        "events": [["halt", leaf] if halt else ["tick", leaf, _WORDS[answer]] for halt, leaf, answer in told],
    }


def compile_case(xml: str, bb: Mapping[str, object], enums: Mapping[str, int], clock: Clock) -> Compiled:
    """Compile a case's tree.

    Args:
        xml: The tree file.
        bb: The blackboard before the first tick.
        enums: The names of numbers.
        clock: The time.
    """
    binding = bind_main(Forest.from_file(parse_xml(xml)), _registry(may_skip=_SKIPS.search(xml) is not None))
    events = Events()
    tree = compile_tree(binding, {Clock: clock, Enums: Enums(enums), Events: events}, bb)
    scopes = {each.scope.path or binding.main.name: each.scope for each in tree.instance.iterate()}
    return Compiled(tree.root, tree.board, scopes, events)


@functools.cache
def _registry(*, may_skip: bool) -> Registry:
    """Return all installed nodes, and the leaves of the traces.

    If no leaf skips, the leaves are registered without SKIPPED, and the tree is made of py_trees' own classes
    as far as possible, which must match the trace as well.
    """
    registry = Registry(load_registry(palettes=["nav2:main"]).specs())
    module = Registry()
    module.add_module(leaves)
    for leaf in module:
        statuses = leaf.statuses if may_skip else leaf.statuses - {"SKIPPED"}
        registry.add(dataclasses.replace(leaf, statuses=statuses, outcomes=()))
    return registry


def replay(case: Case) -> Iterator[Difference]:
    """Replay a case in both modes; yield the first difference of each run that differs."""
    for run in _runs(case):
        difference = _first_difference(case, run)
        if difference is not None:
            yield difference


def reason_for(case: Case, difference: Difference) -> str | None:
    """Return why a difference is intended: it is recognised, or disappears with BehaviorTree.CPP's habits."""
    reason = deviation(case, difference)
    if reason is not None or difference.tick < 0:
        return reason
    for habits in btcpp_behaviour.habits_of(case):
        with btcpp_behaviour.taken_on(habits):
            left = _first_difference(case, difference.run)
        further = None if left is None else deviation(case, left)
        if left is None or (further is not None and left.tick >= difference.tick):
            return "; ".join([*(habit.reason for habit in habits), *([further] if further else [])])
    return None


def _runs(case: Case) -> Iterator[Run]:
    yield from case["runs"]
    if case.get("modes_equal") and "period_ms" not in case:
        # If time passes between ticks, only one mode was recorded.
        (run,) = case["runs"]
        yield {**run, "mode": "exactly_once" if run["mode"] == "once" else "once"}


def _first_difference(case: Case, run: Run) -> Difference | None:
    clock = ManualClock()
    try:
        compiled = compile_case(case["xml"], case.get("bb", {}), case.get("enums", {}), clock)
    except Exception as error:  # noqa: BLE001 - a refusal is an answer, whatever it is
        return None if _is_refused(run) else Difference(run, -1, "refused", "", str(error))
    if "create_exception" in run:
        # A tree that BehaviorTree.CPP rejects may also be rejected when it is ticked.
        seen = next(_ticks(case, run, compiled, clock), None)
        if seen is not None and seen.root == "EXCEPTION":
            return None
        return Difference(run, -1, "accepted", run["create_exception"], _findings_of(case["xml"]))
    for index, (expected, seen) in enumerate(
        zip(run["ticks"], _ticks(case, run, compiled, clock), strict=False)
    ):
        difference = _compare(run, index, expected, seen)
        if difference is not None:
            return difference
    return None


def _findings_of(xml: str) -> str:
    """Return the codes of the findings about a case's tree."""
    found = check(Forest.from_file(parse_xml(xml)), _registry(may_skip=_SKIPS.search(xml) is not None))
    return " ".join(dict.fromkeys(each.code for each in found))


def _is_refused(run: Run) -> bool:
    """Return whether BehaviorTree.CPP fails in or before the first tick of a run, before it ticks a leaf."""
    if "create_exception" in run:
        return True
    first = run["ticks"][0]
    return bool(first["root"] == "EXCEPTION" and not first["events"])


def _ticks(case: Case, run: Run, compiled: Compiled, clock: ManualClock) -> Iterator[Seen]:
    woken: list[bool] = []
    for node in compiled.root.iterate():
        node.setup(wake=lambda: woken.append(True))
    for index in range(case["ticks"]):
        if index and "period_ms" in case:
            clock.advance(case["period_ms"] / 1000 + _LATE_SEC)
        try:
            if index in case.get("halt_before", ()):
                compiled.events.happened.append(["haltTree"])
                btcpp_behaviour.halt_tree(compiled.root)
            outcome = _tick(compiled.root, woken, again=run["mode"] == "once")
        except Exception as error:  # noqa: BLE001 - compared with what BehaviorTree.CPP raised
            yield Seen("EXCEPTION", compiled.events.take(), _blackboards(compiled), str(error))
            return
        yield Seen(outcome, compiled.events.take(), _blackboards(compiled))


def _tick(root: Behaviour, woken: list[bool], *, again: bool) -> str:
    root.tick_once()
    while again and not was_skipped(root) and root.status == Status.RUNNING and woken:
        woken.clear()
        root.tick_once()
    if was_skipped(root):
        return "SKIPPED"
    outcome = root.status
    if outcome != Status.RUNNING:
        btcpp_behaviour.reset(root)
    return outcome.name


def _blackboards(compiled: Compiled) -> dict[str, dict[str, object]]:
    """Return the entries of each tree instance."""
    folders = {
        f"{compiled.board.prefix}/{scope.path}/" if scope.path else f"{compiled.board.prefix}/": path
        for path, scope in compiled.scopes.items()
    }
    found: dict[str, dict[str, object]] = {path: {} for path in compiled.scopes}
    for name in compiled.board.names():
        folder = max((folder for folder in folders if name.startswith(folder)), key=len)
        found[folders[folder]][name.removeprefix(folder)] = compiled.board.get(name)
    return found


def _compare(run: Run, index: int, expected: Mapping[str, Any], seen: Seen) -> Difference | None:
    if expected["root"] == "EXCEPTION" and seen.root == "EXCEPTION":
        return None
    wanted, happened = _in_order(expected["events"], seen.events)
    if wanted != happened:
        return Difference(run, index, "events", _said(wanted), _said(happened), seen.error)
    if expected["root"] != seen.root:
        return Difference(run, index, "root", expected["root"], seen.root, seen.error)
    for path, entries in (expected.get("blackboards") or {}).items():
        ours = seen.blackboards.get(path, {})
        for key in sorted({*(entries or {}), *ours}):
            want, have = (entries or {}).get(key), _exported(ours.get(key))
            if type(want) is not type(have) or want != have:
                return Difference(run, index, f"blackboard {path}: {key}", repr(want), repr(have))
    return None


def _in_order(expected: list[Event], seen: list[Event]) -> tuple[list[Said], list[Said]]:
    """Return the events of a tick whose order matters.

    An event of a timer between two ticks there ("async") happens here in the later tick, possibly after
    others.
    """
    wanted = [_comparable(event) for event in expected if event[-1] != _ASYNC]
    happened = [_comparable(event) for event in seen]
    for event in expected:
        if event[-1] == _ASYNC:
            said = _comparable(event[:-1])
            if said in happened:
                happened.remove(said)
            else:
                wanted.append(said)
    return wanted, happened


def _comparable(event: Event) -> Said:
    """Return an event without the texts of errors, which are not compared."""
    if event[0] == "show" and event[2].startswith("<error:"):
        return (*event[:2], "<error>")
    return tuple(event)


def _said(events: list[Said]) -> str:
    return ", ".join(" ".join(event) for event in events) or "nothing"


def _exported(value: object) -> object:
    """Return a value as BehaviorTree.CPP's JSON represents it."""
    if isinstance(value, bool):
        return int(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def main(arguments: list[str]) -> int:
    """Replay a file of cases; return the exit status."""
    if len(arguments) != 1 or arguments[0].startswith("-"):
        print("usage: replay.py CASES.json", file=sys.stderr)  # noqa: T201
        return _USAGE
    try:
        cases = cases_of(Path(arguments[0]))
    except (OSError, ValueError, KeyError) as error:
        print(f"{arguments[0]} cannot be read: {error}", file=sys.stderr)  # noqa: T201
        return _USAGE
    differing, unexplained = 0, 0
    for case in cases:
        found = [(difference, reason_for(case, difference)) for difference in replay(case)]
        # An unintended difference is more informative than the intended ones.
        found.sort(key=lambda pair: pair[1] is not None)
        for difference, reason in found[:1]:
            differing += 1
            unexplained += reason is None
            print(f"{case['name']}: {difference} [{reason or 'not on the list of deviations'}]")  # noqa: T201
    print(f"{len(cases) - differing} same, {differing} differ")  # noqa: T201
    return 1 if unexplained else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
