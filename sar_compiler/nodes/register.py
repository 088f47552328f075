"""From a class to what is known of its tag: the constructor is the manifest."""

import inspect
import re
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from sar_compiler.errors import SarError
from sar_compiler.nodes.answers import (
    SELF,
    STATUSES,
    answers_of,
    is_fact_name,
    mistake_in,
    placeholders,
)
from sar_compiler.nodes.spec import Direction, Kind, NodeSpec, Parameter, Role, Rule, Skips, Use
from sar_compiler.nodes.values import ANYTHING, ValueType, is_class, value_type_of, without_none
from sar_compiler.runtime.answers import Answer, Fact
from sar_compiler.runtime.context import is_mission_context
from sar_compiler.runtime.ports import InOut, Input, Output

if TYPE_CHECKING:
    import py_trees

C = TypeVar("C", bound=type[Any])

MARK = "__registration__"

CHILD_COUNTS: dict[Kind, tuple[int, int | None]] = {
    Kind.CONTROL: (1, None),
    Kind.DECORATOR: (1, 1),
    Kind.ACTION: (0, 0),
    Kind.CONDITION: (0, 0),
}
"""How many children a node of a kind takes, at least and at most."""
_DIRECTIONS: dict[object, Direction] = {
    Input: Direction.INPUT,
    Output: Direction.OUTPUT,
    InOut: Direction.INOUT,
}
# A name of XML without a colon, which would be a namespace.
_TAG = re.compile(r"[^\W\d][\w.-]*")


class RegistrationError(SarError):
    """A class cannot be the meaning of a tag."""


@dataclass(frozen=True)
class Registration:
    """A class under a tag, its signature not looked at yet (it may name classes defined later).

    Attributes:
        tag: The tag in a tree file.
        cls: The class.
        kind: What it is.
        outcomes: The names of the statuses that a tick can return.
        effects: What it does to the world, in a few words.
        uses: What it needs outside the tree.
        answers: What a tick can come to where there is no robot; where nothing is said, one for each outcome.
        facts: The facts that the answers work on, with their values at the start.
        reads: Further facts or keys of the blackboard that what it does depends on.
        writes: Further facts or keys of the blackboard that it changes.
        defaults: Defaults for parameters that have none in the constructor.
        fixed: Parameters whose value the tag itself says.
        skips: Whether a tick can be skipped.
        skip_cls: The class that takes the place of *cls* where a child can skip.
        skips_if: The attribute, and its value, without which no tick is skipped by the node itself.
        skip_advice: How a node is written that does the same and knows of skipped children, where there is one.
        child_count: How many children it takes, at least and at most; by default what its kind says.
        hidden: Constructor parameters that this tag does not have.
        required: Parameters that must be written, though the constructor can do without.
        factory: Makes the node in place of *cls*, whose signature it then has instead of the constructor.
        variant: Whether it is one more meaning of a tag that means something already: the attributes that a
            file writes choose between them.
        doc: A description to take the place of the class's docstring, for classes of other libraries.
        parameter_docs: Descriptions of parameters, where `doc` is given.
        types: What parameters take, where their annotations say less.
        rule: Reports attributes that do not go with each other, or with the children.
    """

    tag: str
    cls: type[Any]
    kind: Kind
    outcomes: frozenset[str] = frozenset()
    effects: str = ""
    uses: tuple[Use, ...] = ()
    answers: tuple[Answer, ...] = ()
    facts: Mapping[str, Fact] = field(default_factory=dict)
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    defaults: Mapping[str, object] = field(default_factory=dict)
    fixed: Mapping[str, object] = field(default_factory=dict)
    skips: Skips = Skips.NEVER
    skip_cls: type[Any] | None = None
    skips_if: tuple[str, object] | None = None
    skip_advice: str = ""
    child_count: tuple[int, int | None] | None = None
    hidden: frozenset[str] = frozenset()
    required: frozenset[str] = frozenset()
    factory: Callable[..., Any] | None = None
    variant: bool = False
    doc: str = ""
    parameter_docs: Mapping[str, str] = field(default_factory=dict)
    types: Mapping[str, ValueType] = field(default_factory=dict)
    rule: "Rule | None" = None

    def spec(self) -> NodeSpec:
        """Resolve the constructor's signature.

        Raises:
            RegistrationError: If it cannot be written in a tree file; names the parameter.
        """
        summary, parameter_docs = _documentation(self.factory or self.cls)
        summary, parameter_docs = self.doc or summary, {**parameter_docs, **self.parameter_docs}
        try:
            hints = typing.get_type_hints(self.factory or self.cls.__init__, include_extras=True)
        except Exception as error:
            message = f"<{self.tag}>: the annotations of {_name_of(self.cls)} cannot be resolved: {error}"
            raise RegistrationError(message) from error
        found = (
            self._parameter(parameter, hints.get(name), parameter_docs.get(name, ""))
            for name, parameter in self._constructor()
            if name not in self.hidden
        )
        parameters = {parameter.name: parameter for parameter in found}
        self._complain_unless_structured(parameters)
        self._complain_unless_answerable(parameters)
        return NodeSpec(
            tag=self.tag,
            kind=self.kind,
            cls=self.cls,
            factory=self.factory,
            parameters=parameters,
            fixed=self.fixed,
            skips=self.skips,
            skip_cls=self.skip_cls,
            skips_if=self.skips_if,
            skip_advice=self.skip_advice,
            child_count=self.child_count or CHILD_COUNTS[self.kind],
            outcomes=self.outcomes,
            effects=self.effects,
            uses=self.uses,
            answers=self.answers or (answers_of(self.outcomes) if self.kind.is_leaf else ()),
            facts=self.facts,
            reads=self.reads,
            writes=self.writes,
            doc=summary,
            rule=self.rule,
        )

    def _parameter(self, parameter: inspect.Parameter, annotation: object, doc: str) -> Parameter:
        keyword, name = parameter.name, parameter.name.removesuffix("_")
        default = self.defaults.get(name, parameter.default)
        required = default is inspect.Parameter.empty or name in self.required
        common: dict[str, Any] = {
            "required": required,
            "default": None if required else default,
            "doc": doc,
            "keyword": "" if keyword == name else keyword,
        }
        structure = {"name": Role.NAME, "child": Role.CHILD, "children": Role.CHILDREN}.get(name)
        if structure is Role.NAME:
            return Parameter(name, structure, required=False, value_type=value_type_of(str), doc=doc)
        if structure is not None and not self.kind.is_leaf:
            return Parameter(name, structure, required=required, doc=doc)
        if annotation is None:
            message = f"<{self.tag}>: parameter '{keyword}' of {_name_of(self.cls)} has no annotation"
            raise RegistrationError(message)
        target = without_none(annotation)
        direction = _DIRECTIONS.get(typing.get_origin(target) or target)
        value_type = self.types.get(name) or (_carried_type(target) if direction else value_type_of(target))
        if value_type is not None:
            return Parameter(name, Role.ATTRIBUTE, value_type=value_type, direction=direction, **common)
        if is_class(target) and is_mission_context(target):
            return Parameter(name, Role.CONTEXT, target=target, **common)
        if is_class(target) and _is_behaviour(target):
            return Parameter(name, Role.REFERENCE, target=target, **common)
        message = (
            f"<{self.tag}>: parameter '{keyword}' of {_name_of(self.cls)} is annotated with {annotation!r}, which is "
            "neither a value that can be written in a file (float, int, bool, str, an enum, Path, timedelta, a list "
            "of such, or a port such as Input[float]) nor a leaf class nor marked with @mission_context"
        )
        raise RegistrationError(message)

    def _constructor(self) -> list[tuple[str, inspect.Parameter]]:
        """Return the parameters of what makes the node, without `self` and without `*args` and `**kwargs`."""
        if self.factory is not None:
            parameters = list(inspect.signature(self.factory).parameters.items())
        else:
            parameters = list(inspect.signature(self.cls.__init__).parameters.items())[1:]
        variadic = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
        return [(name, parameter) for name, parameter in parameters if parameter.kind not in variadic]

    def _complain_unless_structured(self, parameters: Mapping[str, Parameter]) -> None:
        roles = {parameter.role for parameter in parameters.values()}
        wanted = {Kind.CONTROL: Role.CHILDREN, Kind.DECORATOR: Role.CHILD}.get(self.kind)
        if wanted is not None and wanted not in roles:
            message = f"<{self.tag}>: {_name_of(self.cls)} is a {self.kind.value} without a parameter '{wanted.value}'"
            raise RegistrationError(message)
        if Role.NAME not in roles:
            message = f"<{self.tag}>: the constructor of {_name_of(self.cls)} has no parameter 'name'"
            raise RegistrationError(message)

    def _complain_unless_answerable(self, parameters: Mapping[str, Parameter]) -> None:
        known = [SELF, *(p.name for p in parameters.values() if p.role is Role.REFERENCE)]
        numbers = [p.name for p in parameters.values() if p.is_whole_number]
        for fact in self.facts:
            self._complain_of_placeholders(fact, known)
        for answer in self.answers:
            for text in (answer.when, answer.then):
                self._complain_of_placeholders(text, [*known, *numbers])
            mistake = mistake_in(answer, known, numbers)
            if mistake is not None:
                part, text, error = mistake
                message = f"<{self.tag}>: answer '{answer.name}': {part} '{text}': {error}"
                raise RegistrationError(message)

    def _complain_of_placeholders(self, text: str, known: Sequence[str]) -> None:
        for placeholder in placeholders(text):
            if placeholder not in known:
                braced = ", ".join(f"{{{name}}}" for name in known)
                message = f"<{self.tag}>: '{text}': nothing stands for {{{placeholder}}}; there is {braced}"
                raise RegistrationError(message)


def register(  # noqa: PLR0913 - all that there is to say of a leaf
    tag: str,
    *,
    kind: Kind,
    outcomes: "Iterable[py_trees.common.Status]" = (),
    effects: str = "",
    uses: Iterable[Use] = (),
    answers: Iterable[Answer] = (),
    facts: Mapping[str, Fact] | None = None,
    reads: Iterable[str] = (),
    writes: Iterable[str] = (),
) -> Callable[[C], C]:
    """Make a class the meaning of a tag.

    The decorator only marks the class; it takes part in a registry that loads its module (by the entry
    point `sar_compiler.nodes`, or `--nodes package.module`).

    Args:
        tag: The tag in a tree file.
        kind: What the class is.
        outcomes: The statuses that a tick can return, `runtime.skipping.SKIPPED` among them.
        effects: What it does to the world, in a few words ("drives the robot"); empty if nothing.
        uses: What it needs outside the tree before the first tick.
        answers: For a leaf: what a tick can come to where there is no robot, the usual answer first; one for each
            outcome where nothing is said.
        facts: The facts that the scripts of these answers work on, with their values at the start.
        reads: Further facts or keys of the blackboard that what it does depends on.
        writes: Further facts or keys of the blackboard that it changes.

    Returns:
        A decorator that returns the class unchanged but for the mark.

    Raises:
        RegistrationError: If one of them is not what it must be.

    Example:
        A leaf that a file writes as `<Say message="hi"/>`::

            @register("Say", kind=Kind.ACTION, outcomes={Status.SUCCESS})
            class Say(py_trees.behaviour.Behaviour):
                def __init__(self, name: str, message: str) -> None: ...
    """
    _require_tag(tag)
    _require_kind(tag, kind)
    names = _status_names(tag, outcomes)
    needs = _uses(tag, uses)
    said = _answers(tag, answers, names)
    known = _facts(tag, facts or {})
    read, written = _members(tag, "reads", reads, '["..."]'), _members(tag, "writes", writes, '["..."]')

    def mark(cls: C) -> C:
        registration = Registration(
            tag=tag,
            cls=cls,
            kind=kind,
            outcomes=names,
            effects=effects,
            uses=needs,
            answers=said,
            facts=known,
            reads=read,
            writes=written,
        )
        setattr(cls, MARK, registration)
        return cls

    return mark


def _outcome(status: "py_trees.common.Status") -> str:
    """Name an outcome; INVALID is what `update` returns for skipped (`runtime.skipping.SKIPPED`)."""
    return "SKIPPED" if status.name == "INVALID" else status.name


def _carried_type(port: object) -> ValueType | None:
    """Return the type of what a port carries: `T` of `Input[T]`, anything for a bare `Input`."""
    carried = typing.get_args(port)[0] if typing.get_args(port) else object
    return ANYTHING if carried in (object, Any) else value_type_of(carried)


def _require_tag(tag: object) -> None:
    if isinstance(tag, str) and _TAG.fullmatch(tag):
        return
    message = (
        f"a leaf cannot be registered under {_shown(tag)}: a tag is one word of letters, digits, '_', '-' and '.', "
        "and begins with a letter or '_'"
    )
    raise RegistrationError(message)


def _require_kind(tag: str, kind: object) -> None:
    if isinstance(kind, Kind):
        return
    meant = [each for each in Kind if str(kind).lower() == each.value.lower()]
    choices = " or ".join(f"Kind.{each.name}" for each in meant or Kind)
    message = f"<{tag}>: kind is {_shown(kind)}; write {choices}"
    raise RegistrationError(message)


def _status_names(tag: str, outcomes: object) -> frozenset[str]:
    from py_trees.common import Status

    choices = "Status.SUCCESS, Status.FAILURE or Status.RUNNING"
    statuses = _members(tag, "outcomes", outcomes, "{Status.SUCCESS}")
    for outcome in statuses:
        if not isinstance(outcome, Status):
            meant = f"Status.{outcome}" if outcome in Status.__members__ else choices
            message = f"<{tag}>: outcomes holds {_shown(outcome)}; write {meant}"
            raise RegistrationError(message)
    return frozenset(_outcome(status) for status in statuses)


def _uses(tag: str, uses: object) -> tuple[Use, ...]:
    needs = _members(tag, "uses", uses, '[Use.topic("...")]')
    for use in needs:
        if not isinstance(use, Use):
            message = (
                f"<{tag}>: uses holds {_shown(use)}; write Use.action(name), Use.service(name), "
                "Use.topic(name) or Use.nav2()"
            )
            raise RegistrationError(message)
    return needs


def _answers(tag: str, answers: object, outcomes: frozenset[str]) -> tuple[Answer, ...]:
    said = _members(tag, "answers", answers, '[Answer("SUCCESS")]')
    for answer in said:
        if not isinstance(answer, Answer):
            message = f'<{tag}>: answers holds {_shown(answer)}; write Answer("SUCCESS", "what it means")'
            raise RegistrationError(message)
        possible = sorted(outcomes) or STATUSES
        if answer.status not in possible:
            message = (
                f"<{tag}>: answers holds one with the status {_shown(answer.status)}; the outcomes of this leaf are "
                f"{', '.join(possible)}"
            )
            raise RegistrationError(message)
    twice = [answer.name for index, answer in enumerate(said) if answer in said[:index]]
    if twice:
        message = f"<{tag}>: answers holds '{twice[0]}' twice"
        raise RegistrationError(message)
    return said


def _facts(tag: str, facts: object) -> Mapping[str, Fact]:
    if not isinstance(facts, Mapping):
        message = (
            f"<{tag}>: facts is {_shown(facts)}; write names and values at the start: {{'zones_left': 3}}"
        )
        raise RegistrationError(message)
    for name, value in facts.items():
        if not (isinstance(name, str) and is_fact_name(name)):
            message = (
                f"<{tag}>: a fact cannot be called {_shown(name)}: it is a word of letters, digits and '_'"
            )
            raise RegistrationError(message)
        if not isinstance(value, (bool, int, float, str)):
            message = f"<{tag}>: the fact '{name}' is {_shown(value)}; write a number, a text, True or False"
            raise RegistrationError(message)
    return dict(facts)


def _members(tag: str, argument: str, value: object, example: str) -> tuple[Any, ...]:
    if isinstance(value, Iterable) and not isinstance(value, str):
        return tuple(value)
    message = f"<{tag}>: {argument} is {_shown(value)}; write several or one in brackets, as {example}"
    raise RegistrationError(message)


def _shown(value: object) -> str:
    return f"the text '{value}'" if isinstance(value, str) else repr(value)


def _is_behaviour(cls: type) -> bool:
    from py_trees.behaviour import Behaviour

    return issubclass(cls, Behaviour)


def _name_of(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def _documentation(cls: Callable[..., Any]) -> tuple[str, dict[str, str]]:
    """Return a docstring's first paragraph and the descriptions of its `Args:`."""
    text = inspect.cleandoc(cls.__doc__ or "")
    summary = " ".join(text.split("\n\n", 1)[0].split())
    section = re.search(r"^Args:\n((?:[ ]+.*(?:\n|$)|\n)*)", text, re.MULTILINE)
    described: dict[str, str] = {}
    if section:
        for entry in re.finditer(r"^ {4}(\w+)[^:\n]*:((?:.*)(?:\n {8,}.*)*)", section.group(1), re.MULTILINE):
            described[entry.group(1)] = " ".join(entry.group(2).split())
    return summary, described
