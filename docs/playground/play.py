"""What the playground asks of the package, each time with the text of a tree file; it answers in JSON.

The page runs it in the browser; it is plain Python without ROS.
"""

import json
import tempfile
from collections.abc import Iterable
from pathlib import Path

import sar_compiler
from sar_compiler import LoadedTree, TreeError
from sar_compiler.runtime.events import ANSWERED, HALTED, TickRecord
from sar_compiler.runtime.walking import pre_order
from sar_compiler.views.drawing import svg

# Plain Python in a tab: some 170 states a second.
_MOST_STATES = 5_000
_TICKS = 6
_FILE = Path(tempfile.gettempdir()) / "mission.xml"


def look(text: str) -> str:
    """Return the findings of a tree, and its picture if the text can be understood at all."""
    tree = _load(text)
    findings = [
        {
            "line": each.span.line,
            "column": each.span.column,
            "severity": each.severity.value,
            "code": each.code,
            "message": each.message,
            "suggestion": each.suggestion or "",
        }
        for each in tree.check()
    ]
    try:
        picture = svg(tree.sketch())
    except TreeError:
        picture = ""
    return json.dumps({"findings": findings, "svg": picture})


def prove(text: str) -> str:
    """Return what holds in all runs of a tree; of what does not, a run."""
    tree = _load(text)
    try:
        proof = tree.verify(max_states=_MOST_STATES)
    except TreeError as error:
        return json.dumps({"error": str(error)})
    nodes = _nodes(tree)
    verdicts = [
        {
            "question": each.question,
            "verdict": each.outcome.value,
            "reason": each.reason,
            "ticks": _ticks(each.trace.ticks, nodes) if each.trace else [],
            "loop": each.trace.loop if each.trace else 0,
        }
        for each in proof.verdicts
    ]
    return json.dumps({"states": proof.states, "complete": proof.complete, "verdicts": verdicts})


def play(text: str) -> str:
    """Return the first ticks of a tree whose leaves answer what is usual."""
    tree = _load(text)
    try:
        simulated = tree.simulate().tick(_TICKS)
    except TreeError as error:
        return json.dumps({"error": str(error)})
    return json.dumps({"ticks": _ticks(simulated.run.ticks, _nodes(tree))})


def _load(text: str) -> LoadedTree:
    _FILE.write_text(text, encoding="utf-8")
    return sar_compiler.load(_FILE, models=["nav2:jazzy"], isolated=True)


def _nodes(tree: LoadedTree) -> dict[str, list[int]]:
    """Return the way to each node of the picture, from the root, by its path; what is put around a node is in no path."""
    compiled = tree.preview()
    bound = {each.id: compiled.origins[each.id].bound for each in pre_order(compiled.root)}
    ways: dict[object, list[int]] = {None: []}
    paths: dict[object, list[str]] = {None: []}
    for number, each in enumerate(pre_order(compiled.root)):
        above = None if each is compiled.root else each.parent.id  # type: ignore[union-attr] # others have a parent
        is_wrapper = any(bound[child.id] is bound[each.id] for child in each.children)
        ways[each.id] = [*ways[above], number]
        paths[each.id] = paths[above] + ([] if is_wrapper else [each.name])
    return {"/".join(paths[each]): ways[each] for each in bound}


def _ticks(ticks: Iterable[TickRecord], nodes: dict[str, list[int]]) -> list[dict[str, object]]:
    """Return what happens in each tick, with the nodes of the picture that it happens to."""
    return [
        {
            "root": tick.root,
            "events": [
                {
                    "leaf": event.leaf,
                    "does": event.deed,
                    "status": "halted" if event.what == HALTED else (event.status or "").lower(),
                    "way": nodes.get("/".join(event.path), []),
                }
                for event in tick.events
                if event.what in (ANSWERED, HALTED)
            ],
        }
        for tick in ticks
    ]
