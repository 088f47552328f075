"""The origins of the behaviours of a compiled tree."""

import functools
import weakref
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple
from uuid import UUID

from py_trees.behaviour import Behaviour

from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.instances import Instance
from sar_compiler.nodes.spec import Role, Use
from sar_compiler.runtime.answers import Answer


@dataclass(frozen=True)
class Origin:
    """The origin of a behaviour.

    Attributes:
        bound: The part of the file that it was made from.
        attributes: The values and references it was given, as one would write them: blackboard keys in
            braces where their value was not known, references as names.
        uses: What it needs outside the tree, with names filled in.
    """

    bound: BoundNode
    attributes: Mapping[str, object]
    uses: tuple[Use, ...] = ()


class Construction(NamedTuple):
    """The construction of a behaviour.

    Attributes:
        behaviour: Its id.
        instance: The instance of a subtree that it belongs to.
        bound: The node that it was constructed for.
        wrapper: The attributes of a wrapper around the node; None for the node itself.
        known: The values of plain attributes that came from the blackboard.
    """

    behaviour: UUID
    instance: Instance
    bound: BoundNode
    wrapper: Mapping[str, object] | None = None
    known: Mapping[str, Any] | None = None


class Origins(Mapping[UUID, Origin]):
    """The origins of all behaviours, by their ids; each is computed on request."""

    def __init__(self, constructions: Sequence[Construction]) -> None:
        self._in_order = constructions

    @functools.cached_property
    def _by_id(self) -> dict[UUID, Construction]:
        # Not while the tree is compiled: hashing an id takes as long as everything else that is noted of a node.
        return {each.behaviour: each for each in self._in_order}

    def __getitem__(self, behaviour: UUID) -> Origin:
        _, instance, bound, wrapper, known = self._by_id[behaviour]
        if wrapper is not None:
            return Origin(bound, wrapper)
        attributes = _attributes(instance, bound, known or {})
        uses = tuple(Use(use.kind, use.name.format_map(attributes)) for use in bound.spec.uses)
        return Origin(bound, attributes, uses)

    def construction(self, behaviour: UUID) -> Construction:
        """Return how a behaviour was made."""
        return self._by_id[behaviour]

    def declared_answers(self) -> dict[UUID, tuple[Answer, ...]]:
        """Return the answers of those leaves that have declared what they mean, by their behaviours' ids."""
        return {
            each.behaviour: each.bound.spec.answers
            for each in self._in_order
            if each.wrapper is None
            and each.bound.spec.kind.is_leaf
            and any(answer.label for answer in each.bound.spec.answers)
        }

    def place(self, behaviour: UUID) -> str | None:
        """Return the file and the line that a behaviour was made from; None if it was not made from a file."""
        made = self._by_id.get(behaviour)
        return None if made is None else made.bound.element.file_and_line

    def __iter__(self) -> Iterator[UUID]:
        return (each.behaviour for each in self._in_order)

    def __len__(self) -> int:
        return len(self._in_order)


# By the roots of compiled trees, for whoever has only a behaviour that has failed. Both are others' to keep.
_of_trees: "weakref.WeakKeyDictionary[Behaviour, weakref.ref[Origins]]" = weakref.WeakKeyDictionary()


def remember(root: Behaviour, origins: Origins) -> None:
    """Have the origins of a compiled tree found by its behaviours, for as long as there is the tree."""
    _of_trees[root] = weakref.ref(origins)


def file_and_line_of(behaviour: Behaviour) -> str | None:
    """Return the file and the line that a behaviour, or the one around it, was made from; None if there is none."""
    around: list[Behaviour] = []
    each: Behaviour | None = behaviour
    while each is not None:
        around.append(each)
        origins = _of_trees[each]() if each in _of_trees else None
        if origins is not None:
            places = (origins.place(inner.id) for inner in around)
            return next((place for place in places if place is not None), None)
        each = each.parent
    return None


def _attributes(instance: Instance, bound: BoundNode, known: Mapping[str, Any]) -> dict[str, object]:
    attributes: dict[str, object] = {}
    for name, parameter in bound.spec.parameters.items():
        if parameter.role is Role.ATTRIBUTE:
            if name in known:
                attributes[name] = known[name]
            elif name in bound.keys:
                attributes[name] = f"{{{bound.keys[name]}}}"
            elif name in bound.values:
                attributes[name] = bound.values[name]
            elif parameter.direction is None:
                attributes[name] = bound.spec.fixed.get(name, parameter.default)
    for parameter in bound.spec.references:
        target = instance.target_of(bound, parameter.name)
        if target is not None:
            attributes[parameter.name] = target[1].name
    return attributes
