"""From a class to what is known of its tag: the constructor is the manifest."""

import inspect
import re
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from sar_compiler.errors import SarError
from sar_compiler.nodes.spec import Kind, NodeSpec, Parameter, Role, Use
from sar_compiler.nodes.values import is_class, value_type_of, without_none
from sar_compiler.runtime.context import is_mission_context

if TYPE_CHECKING:
    import py_trees

C = TypeVar("C", bound=type[Any])

MARK = "__registration__"

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
        defaults: Defaults for parameters that have none in the constructor.
        fixed: Parameters whose value the tag itself says.
        doc: A description to take the place of the class's docstring, for classes of other libraries.
        parameter_docs: Descriptions of parameters, where `doc` is given.
    """

    tag: str
    cls: type[Any]
    kind: Kind
    outcomes: frozenset[str] = frozenset()
    effects: str = ""
    uses: tuple[Use, ...] = ()
    defaults: Mapping[str, object] = field(default_factory=dict)
    fixed: Mapping[str, object] = field(default_factory=dict)
    doc: str = ""
    parameter_docs: Mapping[str, str] = field(default_factory=dict)

    def spec(self) -> NodeSpec:
        """Resolve the constructor's signature.

        Raises:
            RegistrationError: If it cannot be written in a tree file; names the parameter.
        """
        summary, parameter_docs = (self.doc, self.parameter_docs) if self.doc else _documentation(self.cls)
        try:
            hints = typing.get_type_hints(self.cls.__init__)
        except Exception as error:
            message = f"<{self.tag}>: the annotations of {_name_of(self.cls)} cannot be resolved: {error}"
            raise RegistrationError(message) from error
        parameters = {
            name: self._parameter(parameter, hints.get(name), parameter_docs.get(name, ""))
            for name, parameter in _constructor(self.cls)
        }
        self._complain_unless_structured(parameters)
        return NodeSpec(
            tag=self.tag,
            kind=self.kind,
            cls=self.cls,
            parameters=parameters,
            fixed=self.fixed,
            outcomes=self.outcomes,
            effects=self.effects,
            uses=self.uses,
            doc=summary,
        )

    def _parameter(self, parameter: inspect.Parameter, annotation: object, doc: str) -> Parameter:
        name = parameter.name
        default = self.defaults.get(name, parameter.default)
        required = default is inspect.Parameter.empty
        default = None if required else default
        structure = {"name": Role.NAME, "child": Role.CHILD, "children": Role.CHILDREN}.get(name)
        if structure is Role.NAME:
            return Parameter(name, structure, required=False, value_type=value_type_of(str), doc=doc)
        if structure is not None and not self.kind.is_leaf:
            return Parameter(name, structure, required=required, doc=doc)
        if annotation is None:
            message = f"<{self.tag}>: parameter '{name}' of {_name_of(self.cls)} has no annotation"
            raise RegistrationError(message)
        target = without_none(annotation)
        value_type = value_type_of(annotation)
        if value_type is not None:
            return Parameter(name, Role.ATTRIBUTE, required, default, value_type=value_type, doc=doc)
        if is_class(target) and is_mission_context(target):
            return Parameter(name, Role.CONTEXT, required, default, target=target, doc=doc)
        if is_class(target) and _is_behaviour(target):
            return Parameter(name, Role.REFERENCE, required, default, target=target, doc=doc)
        message = (
            f"<{self.tag}>: parameter '{name}' of {_name_of(self.cls)} is annotated with {annotation!r}, which is "
            "neither a value that can be written in a file (float, int, bool, str, an enum, Path, timedelta) "
            "nor a leaf class nor marked with @mission_context"
        )
        raise RegistrationError(message)

    def _complain_unless_structured(self, parameters: Mapping[str, Parameter]) -> None:
        roles = {parameter.role for parameter in parameters.values()}
        wanted = {Kind.CONTROL: Role.CHILDREN, Kind.DECORATOR: Role.CHILD}.get(self.kind)
        if wanted is not None and wanted not in roles:
            message = f"<{self.tag}>: {_name_of(self.cls)} is a {self.kind.value} without a parameter '{wanted.value}'"
            raise RegistrationError(message)
        if Role.NAME not in roles:
            message = f"<{self.tag}>: the constructor of {_name_of(self.cls)} has no parameter 'name'"
            raise RegistrationError(message)


def register(
    tag: str,
    *,
    kind: Kind,
    outcomes: "Iterable[py_trees.common.Status]" = (),
    effects: str = "",
    uses: Iterable[Use] = (),
) -> Callable[[C], C]:
    """Make a class the meaning of a tag.

    The decorator only marks the class; it takes part in a registry that loads its module (by the entry
    point `sar_compiler.nodes`, or `--nodes package.module`).

    Args:
        tag: The tag in a tree file.
        kind: What the class is.
        outcomes: The statuses that a tick can return.
        effects: What it does to the world, in a few words ("drives the robot"); empty if nothing.
        uses: What it needs outside the tree before the first tick.

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

    def mark(cls: C) -> C:
        registration = Registration(tag=tag, cls=cls, kind=kind, outcomes=names, effects=effects, uses=needs)
        setattr(cls, MARK, registration)
        return cls

    return mark


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
    return frozenset(status.name for status in statuses)


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


def _members(tag: str, argument: str, value: object, example: str) -> tuple[Any, ...]:
    if isinstance(value, Iterable) and not isinstance(value, str):
        return tuple(value)
    message = f"<{tag}>: {argument} is {_shown(value)}; write several or one in brackets, as {example}"
    raise RegistrationError(message)


def _shown(value: object) -> str:
    return f"the text '{value}'" if isinstance(value, str) else repr(value)


def _constructor(cls: type[Any]) -> list[tuple[str, inspect.Parameter]]:
    parameters = list(inspect.signature(cls.__init__).parameters.items())[1:]
    variadic = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return [(name, parameter) for name, parameter in parameters if parameter.kind not in variadic]


def _is_behaviour(cls: type) -> bool:
    from py_trees.behaviour import Behaviour

    return issubclass(cls, Behaviour)


def _name_of(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def _documentation(cls: type[Any]) -> tuple[str, dict[str, str]]:
    """Return a docstring's first paragraph and the descriptions of its `Args:`."""
    text = inspect.cleandoc(cls.__doc__ or "")
    summary = " ".join(text.split("\n\n", 1)[0].split())
    section = re.search(r"^Args:\n((?:[ ]+.*(?:\n|$)|\n)*)", text, re.MULTILINE)
    described: dict[str, str] = {}
    if section:
        for entry in re.finditer(r"^ {4}(\w+)[^:\n]*:((?:.*)(?:\n {8,}.*)*)", section.group(1), re.MULTILINE):
            described[entry.group(1)] = " ".join(entry.group(2).split())
    return summary, described
