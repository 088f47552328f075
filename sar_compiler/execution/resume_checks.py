"""Compatibility checks before a mission resumes from a journal: the same tree, and the same mission.

A crashed process takes the state of its tree with it; only the events in the journal remain. A resumed tree therefore starts over, and its
leaves skip the work that the events show as done. This is only right if the events mean the same as before: a place that was moved since
would be skipped although the robot never visited its new position. So every difference is an error before the first tick.
"""

from collections.abc import Mapping
from typing import Any

from py_trees.behaviour import Behaviour

from sar_compiler.compiler import CompiledTree
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal import Journal
from sar_compiler.missions.parameter_reader import ParameterError, ParameterProblem
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.tree.diagnostic import TreeError

_ADVICE = "or start over and keep that journal with --new"


def require_same_identity(journal: Journal, about: Mapping[str, Any]) -> None:
    """Compare the identity of a mission with that of the mission in a journal.

    Args:
        journal: The journal.
        about: `mission`, `simulated` and `identity` of the resuming mission.

    Raises:
        JournalError: If it is another mission.
        ParameterError: If its identity differs; names each parameter.
    """
    there: Any = journal.description
    if there.get("mission") != about["mission"]:
        raise JournalError(
            f"the journal {journal.path} belongs to {_mission_text(there.get('mission'))}, but this is "
            f"{_mission_text(about['mission'])}: "
            f"name another file, {_ADVICE}"
        )
    if there.get("simulated") != about["simulated"]:
        which, other = ("simulation", "robot") if there.get("simulated") else ("robot", "simulation")
        raise JournalError(
            f"the mission in the journal {journal.path} was started with a {which}, and cannot be resumed with a {other}: name "
            f"another file, {_ADVICE}"
        )
    then = _mapping(there.get("identity"))
    problems = [
        ParameterProblem(
            key, f"is {now!r}, but {then.get(key)!r} in the journal {journal.path}: use that, {_ADVICE}"
        )
        for key, now in about["identity"].items()
        if now != then.get(key)
    ]
    if problems:
        raise ParameterError(problems)


def _mission_text(mission: str | None) -> str:
    return "a tree without a mission" if mission is None else f"the mission '{mission}'"


def require_same_tree(journal: Journal, tree: CompiledTree, outline: Mapping[str, Any]) -> None:
    """Compare a tree with the tree in a journal.

    Args:
        journal: The journal.
        tree: The tree of the resuming mission.
        outline: Its outline in the journal's form: nested nodes.

    Raises:
        TreeError: If the trees differ; names the first difference.
    """
    difference = _difference(journal.description.get("tree"), outline, tree.root)
    if difference is None:
        return
    behaviour, words = difference
    collector = FindingCollector()
    element = tree.origins[behaviour.id].bound.element
    message = f"the mission in {journal.path} has a different tree: {words}"
    collector.add("other-tree", message, element, hint=f"resume with that tree, {_ADVICE}")
    raise TreeError(collector.findings)


def _difference(then: Any, now: Mapping[str, Any], behaviour: Behaviour) -> tuple[Behaviour, str] | None:
    """Return the first behaviour that has changed, and the change; None if there is none."""
    then = _mapping(then)
    for key in ("class", "name", "memory", "policy"):
        if then.get(key) != now.get(key):
            return behaviour, f"{key} is {_value(now.get(key))} here, but was {_value(then.get(key))}"
    were, are = _mapping(then.get("attributes")), now["attributes"]
    for key in sorted({*were, *are}):
        if were.get(key) != are.get(key):
            return behaviour, f"{key} is {_value(are.get(key))} here, but was {_value(were.get(key))}"
    children = then["children"] if isinstance(then.get("children"), list) else []
    for index, child in enumerate(behaviour.children[: len(children)]):
        found = _difference(children[index], now["children"][index], child)
        if found is not None:
            return found
    if len(children) != len(behaviour.children):
        count = len(behaviour.children)
        noun = "child" if count == 1 else "children"
        return behaviour, f"'{behaviour.name}' has {count} {noun} here, but had {len(children)}"
    return None


def _mapping(value: object) -> Mapping[str, Any]:
    """Return a mapping; empty if a damaged journal lacks it."""
    return value if isinstance(value, Mapping) else {}


def _value(value: object) -> str:
    return "not given" if value is None else repr(value)
