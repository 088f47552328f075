"""Check, before a mission resumes, that its tree and its identity match the journal.

The state of the tree is lost when its process crashes; only the events in the journal remain. A resumed tree therefore starts over, and its
leaves skip the work that the events record as done. This is only correct if the events still have the same meaning. For example, if the
position of a place has changed since then, the place would be skipped although the robot has never been at the new position. So every
difference is reported as an error before the first tick.
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

_ADVICE = "or start over with --new, which keeps that journal under another name"


def require_same_identity(journal: Journal, about: Mapping[str, Any]) -> None:
    """Check that a mission to resume is the same mission as the one in the journal.

    Args:
        journal: The journal.
        about: The values `mission`, `simulated` and `identity` of the mission to resume.

    Raises:
        JournalError: If the journal belongs to another mission, or if exactly one of the two runs is simulated.
        ParameterError: If a parameter of the mission's identity differs. The error names each such parameter.
    """
    recorded: Any = journal.description
    if recorded.get("mission") != about["mission"]:
        raise JournalError(
            f"the journal {journal.path} belongs to {_mission_text(recorded.get('mission'))}, but this is "
            f"{_mission_text(about['mission'])}. Select another file with --journal, {_ADVICE}"
        )
    if recorded.get("simulated") != about["simulated"]:
        which, other = ("simulation", "robot") if recorded.get("simulated") else ("robot", "simulation")
        raise JournalError(
            f"the mission in the journal {journal.path} was started with a {which}, and cannot be resumed with a {other}. "
            f"Select another file with --journal, {_ADVICE}"
        )
    then = _mapping(recorded.get("identity"))
    problems = [
        ParameterProblem(
            key,
            f"is {now!r}, but the journal {journal.path} contains {then.get(key)!r}. Use the journal's value, {_ADVICE}",
        )
        for key, now in about["identity"].items()
        if now != then.get(key)
    ]
    if problems:
        raise ParameterError(problems)


def _mission_text(mission: str | None) -> str:
    return "a tree without a mission" if mission is None else f"the mission '{mission}'"


def require_same_tree(journal: Journal, tree: CompiledTree, outline: Mapping[str, Any]) -> None:
    """Check that a mission to resume has the same tree as the mission in the journal.

    Args:
        journal: The journal.
        tree: The tree of the mission to resume.
        outline: The tree's nested nodes, in the journal's form.

    Raises:
        TreeError: If the trees differ. The error names the first difference.
    """
    difference = _difference(journal.description.get("tree"), outline, tree.root)
    if difference is None:
        return
    behaviour, words = difference
    collector = FindingCollector()
    element = tree.origins[behaviour.id].bound.element
    message = f"the mission in {journal.path} has a different tree: {words}"
    collector.add("other-tree", message, element, hint=f"resume with the journal's tree, {_ADVICE}")
    raise TreeError(collector.findings)


def _difference(then: Any, now: Mapping[str, Any], behaviour: Behaviour) -> tuple[Behaviour, str] | None:
    """Return the first behaviour that differs from the journal's tree, and describe the difference.

    Return None if the trees are equal.
    """
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
    """Return the value if it is a mapping; otherwise return an empty mapping.

    In a damaged journal, the value can have a wrong type.
    """
    return value if isinstance(value, Mapping) else {}


def _value(value: object) -> str:
    return "not given" if value is None else repr(value)
