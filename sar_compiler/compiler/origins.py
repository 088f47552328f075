"""Where the behaviours of a compiled tree come from."""

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from uuid import UUID

from sar_compiler.nodes.binding.bound import BoundNode
from sar_compiler.nodes.binding.instances import Instance
from sar_compiler.nodes.spec import Role, Use


@dataclass(frozen=True)
class Origin:
    """Where a behaviour comes from.

    Attributes:
        bound: The part of the file that it was made from.
        attributes: The values and references it was given, as one would write them: blackboard keys in
            braces where their value was not known, references as names.
        uses: What it needs outside the tree, with names filled in.
    """

    bound: BoundNode
    attributes: Mapping[str, object]
    uses: tuple[Use, ...] = ()


Making = tuple[UUID, Instance, BoundNode, Mapping[str, object] | None, Mapping[str, Any] | None]
"""How a behaviour was made: its id, the instance that it belongs to, the node that it was made for, the attributes
of a wrapper around the node (None for the node itself), and values of plain attributes from the blackboard.

A plain tuple, as there is one for every node."""


class Origins(Mapping[UUID, Origin]):
    """The origins of all behaviours, by their ids; each is worked out when somebody asks.

    Args:
        makings: How each was made.
    """

    def __init__(self, makings: Sequence[Making]) -> None:
        self._in_order = makings

    @functools.cached_property
    def _makings(self) -> dict[UUID, Making]:
        # Not while the tree is made: to hash an id takes as long as all else that is noted of a node.
        return {making[0]: making for making in self._in_order}

    def __getitem__(self, behaviour: UUID) -> Origin:
        _, instance, bound, wrapper, known = self._makings[behaviour]
        if wrapper is not None:
            return Origin(bound, wrapper)
        attributes = _attributes(instance, bound, known or {})
        uses = tuple(Use(use.kind, use.name.format_map(attributes)) for use in bound.spec.uses)
        return Origin(bound, attributes, uses)

    def __iter__(self) -> Iterator[UUID]:
        return (making[0] for making in self._in_order)

    def __len__(self) -> int:
        return len(self._in_order)


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
        target = instance.referred(bound, parameter.name)
        if target is not None:
            attributes[parameter.name] = target[1].name
    return attributes
