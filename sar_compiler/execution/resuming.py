"""What a mission must have in common with the one in a journal to go on with it: the tree, and what it is about."""

from collections.abc import Mapping
from typing import Any

from py_trees.behaviour import Behaviour

from sar_compiler.compiler import CompiledTree
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal import Journal
from sar_compiler.missions.parameter_reader import ParameterError, Problem
from sar_compiler.nodes.collector import Collector
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.json_values import json_text, json_value

_ADVICE = "or begin anew, and keep that journal: --new"


def as_data(value: object) -> Any:
    """Return a value as it is read from a journal: JSON values, arrays as lists."""
    return json_value(json_text(value, default=_plain))


def _plain(value: Any) -> Any:
    return [*value] if hasattr(value, "__iter__") else str(value)


def require_same_identity(journal: Journal, about: Mapping[str, Any]) -> None:
    """Hold what a mission is about against what the one in a journal is about.

    Args:
        journal: The journal.
        about: `mission`, `simulated` and `identity` of the mission that is to go on with it.

    Raises:
        JournalError: If it is another mission.
        ParameterError: If it is about something else; names each parameter.
    """
    there: Any = journal.about
    if there.get("mission") != about["mission"]:
        raise JournalError(
            f"the journal {journal.place} is of {_called(there.get('mission'))}, and this is {_called(about['mission'])}: "
            f"name another file, {_ADVICE}"
        )
    if there.get("simulated") != about["simulated"]:
        which, other = ("simulation", "robot") if there.get("simulated") else ("robot", "simulation")
        raise JournalError(
            f"the mission in the journal {journal.place} was begun with a {which}, and cannot go on with a {other}: name "
            f"another file, {_ADVICE}"
        )
    then = _mapping(there.get("identity"))
    problems = [
        Problem(
            key, f"is {now!r}, and in the journal {journal.place} {then.get(key)!r}: give that, {_ADVICE}"
        )
        for key, now in about["identity"].items()
        if now != then.get(key)
    ]
    if problems:
        raise ParameterError(problems)


def _called(mission: str | None) -> str:
    return "a tree of no mission" if mission is None else f"the mission '{mission}'"


def require_same_tree(journal: Journal, tree: CompiledTree, outline: Mapping[str, Any]) -> None:
    """Hold a tree against that of a journal.

    Args:
        journal: The journal.
        tree: The tree that is to go on with it.
        outline: The same as the journal has trees: nested nodes.

    Raises:
        TreeError: If it is another one; has the first difference.
    """
    difference = _difference(journal.about.get("tree"), outline, tree.root)
    if difference is None:
        return
    behaviour, words = difference
    collector = Collector()
    element = tree.origins[behaviour.id].bound.element
    message = f"the mission in {journal.place} has another tree: {words}"
    collector.add("other-tree", message, element, hint=f"go on with that tree, {_ADVICE}")
    raise TreeError(collector.findings)


def _difference(then: Any, now: Mapping[str, Any], behaviour: Behaviour) -> tuple[Behaviour, str] | None:
    """Return the first behaviour that is not as it was, and what is not; None if all are."""
    then = _mapping(then)
    for key in ("class", "name", "memory", "policy"):
        if then.get(key) != now.get(key):
            return behaviour, f"{key} is {_value(now.get(key))} here, and was {_value(then.get(key))}"
    were, are = _mapping(then.get("attributes")), now["attributes"]
    for key in sorted({*were, *are}):
        if were.get(key) != are.get(key):
            return behaviour, f"{key} is {_value(are.get(key))} here, and was {_value(were.get(key))}"
    children = then["children"] if isinstance(then.get("children"), list) else []
    for index, child in enumerate(behaviour.children[: len(children)]):
        found = _difference(children[index], now["children"][index], child)
        if found is not None:
            return found
    if len(children) != len(behaviour.children):
        count = len(behaviour.children)
        noun = "child" if count == 1 else "children"
        return behaviour, f"'{behaviour.name}' has {count} {noun} here, and had {len(children)}"
    return None


def _mapping(value: object) -> Mapping[str, Any]:
    """Return what a damaged journal may not have."""
    return value if isinstance(value, Mapping) else {}


def _value(value: object) -> str:
    return "not given" if value is None else repr(value)
