"""Scripted runs as JSON, for other tools."""

from collections.abc import Sequence

from sar_compiler.checks.simulate.coverage import Coverage, Covered
from sar_compiler.checks.simulate.running import Run, TickRecord
from sar_compiler.views.junit import PlayedScenario
from sar_compiler.views.plain import as_json, plain


def runs_as_json(tree: str, scenarios: Sequence[PlayedScenario], coverage: Coverage | None = None) -> str:
    """Return the played scenarios as a JSON object; times are simulated seconds."""
    result: dict[str, object] = {"file": tree, "scenarios": [_scenario(each) for each in scenarios]}
    if coverage is not None:
        result["coverage"] = {
            "never_ticked": [_node(each) for each in coverage.never_ticked],
            "unseen": [{**_node(each), "outcomes": each.unseen} for each in coverage.unseen],
        }
    return as_json(result)


def _scenario(played: PlayedScenario) -> dict[str, object]:
    run = played.run
    if run is None:
        return {"name": played.name, "holds": None, "problem": played.problem}
    return {
        "name": played.name,
        "file": run.scenario.path or None,
        "holds": not played.failures,
        "failures": [
            {"expected": each.expected, "message": each.message, "line": each.line or None}
            for each in played.failures
        ],
        "ended": run.ended,
        "root": run.root,
        "time": run.time_sec,
        "facts": run.simulated.fact_values(),
        "ticks": [_tick(run, tick) for tick in run.ticks],
    }


def _tick(run: Run, tick: TickRecord) -> dict[str, object]:
    names = {behaviour.id: behaviour.name for behaviour in run.simulated.root.iterate()}
    return {
        "tick": tick.number,
        "time": tick.time_sec,
        "root": tick.root,
        "events": [
            {
                "leaf": "/".join(event.leaf.path),
                "what": event.what,
                "answer": event.answer.name if event.answer else None,
                "status": event.answer.status if event.answer else None,
            }
            for event in tick.events
        ],
        "facts": {name: plain(value) for name, value in tick.facts.items()},
        "keys": {name: plain(value) for name, value in tick.keys.items()},
        "statuses": [{"node": names[node], "status": status} for node, status in tick.statuses.items()],
    }


def _node(covered: Covered) -> dict[str, object]:
    element = covered.bound.element
    return {"name": covered.bound.name, "file": element.source.path, "line": element.line}
