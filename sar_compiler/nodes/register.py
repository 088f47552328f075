"""Registration of node classes for tags."""

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NoReturn, TypeVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.nodes.outcome_sets import ALL
from sar_compiler.nodes.outcomes import is_fact_name
from sar_compiler.nodes.semantics import Semantics
from sar_compiler.nodes.spec import CHILD_COUNTS, MARK, Kind, NodeSpec, RegistrationError, Use
from sar_compiler.runtime.outcomes import STATUSES, Fact, Outcome

C = TypeVar("C", bound=type[Any])

# An XML name without a colon, which would separate a namespace.
_TAG = re.compile(r"[^\W\d][\w.-]*")


def register(  # noqa: PLR0913 - the declarations of a node
    tag: str,
    *,
    kind: Kind | None = None,
    outcomes: Iterable[Status | Outcome] = (),
    effects: str = "",
    uses: Iterable[Use] = (),
    facts: Mapping[str, Fact] | None = None,
    reads: Iterable[str] = (),
    writes: Iterable[str] = (),
    semantics: Semantics | None = None,
    child_count: tuple[int, int | None] | None = None,
) -> Callable[[C], C]:
    """Register a class for a tag.

    The decorator only marks the class. A registry adds the class when it loads the class's module, through the entry point
    `sar_compiler.nodes` or through `--nodes package.module`.

    Args:
        tag: The tag in a tree file.
        kind: The kind of the node.
        outcomes: The outcomes of a tick: statuses, possibly `runtime.skipping.SKIPPED`, or labelled outcomes of a leaf,
            the most common outcome first. A leaf without declared outcomes may return any status except SKIPPED.
        effects: The node's effect on the world, in a few words ("drives the robot"); empty if it has no effect.
        uses: The actions, services and topics that the node needs before the first tick.
        facts: The facts that the scripts of the outcomes use, with their initial values.
        reads: Further facts or blackboard keys on which the node's behaviour depends.
        writes: Further facts or blackboard keys that the node changes.
        semantics: The way a control or decorator ticks its children, for example `Semantics.sequence()`. Without
            semantics, checks know only the node's outcomes and can conclude little.
        child_count: The minimum and maximum number of a control's children (None for no limit); by default at least 1.

    Returns:
        A decorator that returns the class, unchanged except for the mark.

    Raises:
        RegistrationError: If an argument is invalid.

    Example:
        A leaf for the element `<Say message="hi"/>`::

            @register("Say", kind=Kind.ACTION, outcomes={Status.SUCCESS})
            class Say(py_trees.behaviour.Behaviour):
                def __init__(self, name: str, message: str) -> None: ...
    """
    _require_tag(tag)
    kind = _required_kind(tag, kind)
    statuses, labelled = _outcomes(tag, outcomes)
    needs = _uses(tag, uses)
    known = _facts(tag, facts or {})
    read, written = _members(tag, "reads", reads, '["..."]'), _members(tag, "writes", writes, '["..."]')

    _require_semantics(tag, semantics)
    numbers = _child_count(tag, kind, child_count)

    def mark(cls: C) -> C:
        _require_behaviour(tag, cls)
        means = _guard_functions(tag, cls, semantics or Semantics())
        spec = NodeSpec(
            tag,
            cls,
            kind,
            statuses,
            effects,
            needs,
            labelled,
            known,
            read,
            written,
            means,
            child_count=numbers,
        )
        setattr(cls, MARK, spec)
        return cls

    return mark


def _refuse(what: str, value: object, advice: str) -> NoReturn:
    """Raise an error about a wrong argument."""
    raise RegistrationError(f"{what} {_quote(value)}{advice}")


def _require_tag(tag: object) -> None:
    if isinstance(tag, type):
        name = tag.__name__
        message = f'{tag.__module__}.{name}: @register needs the tag and the kind: write @register("{name}", kind=Kind.ACTION)'
        raise RegistrationError(f"{message}, or another kind")
    if isinstance(tag, str) and _TAG.fullmatch(tag):
        return
    raise RegistrationError(
        f"{_quote(tag)} is not a valid tag: a tag is one word of letters, digits, '_', '-' and '.', "
        "and begins with a letter or '_'"
    )


def _required_kind(tag: str, kind: object) -> Kind:
    if kind is None:
        raise RegistrationError(
            f'<{tag}>: kind is missing: write @register("{tag}", kind=Kind.ACTION), or another kind'
        )
    if not isinstance(kind, Kind):
        meant = [each for each in Kind if str(kind).lower() == each.value.lower()]
        choices = " or ".join(f"Kind.{each.name}" for each in meant or Kind)
        _refuse(f"<{tag}>: kind is", kind, f"; write {choices}")
    return kind


def _require_semantics(tag: str, semantics: object) -> None:
    if not isinstance(semantics, (Semantics, type(None))):
        _refuse(f"<{tag}>: semantics is", semantics, "; write for example Semantics.sequence()")


def _child_count(tag: str, kind: Kind, count: object) -> tuple[int, int | None]:
    if count is None:
        return CHILD_COUNTS[kind]
    if kind is not Kind.CONTROL:
        raise RegistrationError(f"<{tag}>: child_count is allowed only for controls: remove it")
    match count:
        case (int(least), int() | None as most) if 1 <= least <= (least if most is None else most):
            return least, most
    advice = "; write the minimum and maximum number of children: (2, 3), or (2, None) for no limit"
    _refuse(f"<{tag}>: child_count is", count, advice)


_FUNCTIONS = ("possible", "gates", "rounds", "limit_sec", "wait_sec")
"""The fields of `Semantics` that contain functions. Checks call these functions."""


class _UserFunction:
    """A wrapper of a user's function in a `Semantics`.

    The wrapper checks the function's result, and its errors name the node class.
    """

    def __init__(self, whose: str, name: str, function: Callable[..., Any]) -> None:
        self._whose = whose
        self._name = name
        self._function = function

    def __call__(self, bound: Any, *others: Any) -> Any:
        """Call the function and check its result."""
        try:
            found = self._function(bound, *others)
        except Exception as error:
            message = f"{self._whose} raised {type(error).__name__}: {error}, for '{bound.name}' on line {bound.element.line}"
            raise RegistrationError(message) from error
        if self._name == "possible" and not (isinstance(found, int) and 0 <= found <= ALL):
            raise RegistrationError(
                f"{self._whose} returned {_quote(found)}. Return an outcome set, for example the set of a child"
            )
        return found


def _guard_functions(tag: str, cls: type[Any], semantics: Semantics) -> Semantics:
    """Return semantics whose user-defined functions are wrapped in `_UserFunction`."""
    guarded: dict[str, Any] = {}
    for name in _FUNCTIONS:
        function = getattr(semantics, name)
        home = getattr(getattr(function, "func", function), "__module__", None)
        if function is not None and not str(home).startswith("sar_compiler.nodes."):
            whose = f"<{tag}>: the function '{name}' in the semantics of {cls.__module__}.{cls.__qualname__}"
            guarded[name] = _UserFunction(whose, name, function)
    return semantics._replace(**guarded) if guarded else semantics


def _require_behaviour(tag: str, cls: object) -> None:
    if not (isinstance(cls, type) and issubclass(cls, Behaviour)):
        raise RegistrationError(
            f"<{tag}>: {_quote(cls)} is not a behaviour class; derive it from py_trees.behaviour.Behaviour"
        )


def _outcomes(tag: str, outcomes: object) -> tuple[frozenset[str], tuple[Outcome, ...]]:
    """Return the statuses, and also the outcomes if at least one argument is an `Outcome`."""
    given = _members(tag, "outcomes", outcomes, "{Status.SUCCESS}")
    possible = tuple(_outcome(tag, each) for each in given)
    twice = [each.name for index, each in enumerate(possible) if each in possible[:index]]
    if twice:
        raise RegistrationError(f"<{tag}>: outcomes contains '{twice[0]}' twice")
    is_labelled = any(isinstance(each, Outcome) for each in given)
    return frozenset(each.status for each in possible), possible if is_labelled else ()


def _outcome(tag: str, outcome: object) -> Outcome:
    if isinstance(outcome, Status):
        # INVALID is `runtime.skipping.SKIPPED`.
        return Outcome("SKIPPED" if outcome is Status.INVALID else outcome.name)
    if not isinstance(outcome, Outcome):
        is_name = isinstance(outcome, str) and outcome in Status.__members__
        meant = outcome if is_name else "SUCCESS, Status.FAILURE or Status.RUNNING"
        _refuse(
            f"<{tag}>: outcomes contains", outcome, f'; write Status.{meant}, or Outcome("SUCCESS", "label")'
        )
    if outcome.status not in STATUSES:
        advice = f"; write one of {', '.join(STATUSES)}"
        _refuse(f"<{tag}>: outcomes contains an outcome with the status", outcome.status, advice)
    return outcome


def _uses(tag: str, uses: object) -> tuple[Use, ...]:
    needs = _members(tag, "uses", uses, '[Use.topic("...")]')
    for use in needs:
        if not isinstance(use, Use):
            advice = (
                "; write Use.action(name), Use.service(name), Use.topic(name), Use.transforms() or Use.nav2()"
            )
            _refuse(f"<{tag}>: uses contains", use, advice)
    return needs


def _facts(tag: str, facts: object) -> Mapping[str, Fact]:
    if not isinstance(facts, Mapping):
        _refuse(
            f"<{tag}>: facts is",
            facts,
            "; write names and initial values, for example {'zones_left': 3}",
        )
    for name, value in facts.items():
        if not (isinstance(name, str) and is_fact_name(name)):
            raise RegistrationError(
                f"<{tag}>: {_quote(name)} is not a valid fact name: use letters, digits and '_'"
            )
        if not isinstance(value, (bool, int, float, str)):
            _refuse(f"<{tag}>: the fact '{name}' is", value, "; write a number, a string, True or False")
    return dict(facts)


def _members(tag: str, argument: str, value: object, example: str) -> tuple[Any, ...]:
    if isinstance(value, Iterable) and not isinstance(value, str):
        return tuple(value)
    _refuse(f"<{tag}>: {argument} is", value, f"; write a list or tuple, such as {example}")


def _quote(value: object) -> str:
    return f"the string '{value}'" if isinstance(value, str) else repr(value)
