"""What behaviours of a user's classes remember in their attributes, as a value that can be compared, kept and put back."""

import logging
import math
import re
import types
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Mapping
from datetime import date, time, timedelta, tzinfo
from decimal import Decimal
from enum import Enum
from fractions import Fraction
from pathlib import PurePath
from typing import Any, Final
from uuid import UUID

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Success
from py_trees.blackboard import Blackboard, Client
from py_trees.logging import Logger

from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.blackboard import Board, Entry, Scope
from sar_compiler.runtime.clock import ManualClock, WallClock
from sar_compiler.runtime.enums import Enums
from sar_compiler.runtime.frozen import PLAIN
from sar_compiler.runtime.pausing import Called, held_by
from sar_compiler.runtime.ports import Input, Output
from sar_compiler.runtime.possible_time import PossibleTime

# What comes first in a taken value: how it is put back.
_SAME, _FLOAT, _AGAIN, _FIXED, _ITEMS, _DICT, _FUNCTION, _METHOD, _KEPT, _MADE, _TIME = range(11)

_COMMON: Final = frozenset(vars(Success(""))) - {"feedback_message"} | {
    "place",
    "skipped",
    "stop",
    "tick",
    "update",
}
"""The attributes that every behaviour has, and what is in cells: who it is, its place in the tree, its status."""
_IMMUTABLE = (
    Enum, UUID, date, time, timedelta, tzinfo, PurePath, Decimal, Fraction, complex, range, re.Pattern, type,
    types.BuiltinFunctionType, types.ModuleType, types.EllipsisType, types.NotImplementedType,
)  # fmt: skip
# What these hold is part of the state by itself, or makes no difference.
_ELSEWHERE = (
    Board, Called, Client, Enums, Entry, Input, Logger, ManualClock, Scope, WallClock, logging.Logger,
)  # fmt: skip


class UnkeepableError(UndecidableError):
    """An attribute of a user's object holds what can neither be copied nor compared."""


class Identity:
    """An object that is kept as it is, and is equal to nothing but itself.

    Args:
        value: The object.
    """

    def __init__(self, value: Any) -> None:
        self.value = value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Identity) and other.value is self.value

    def __hash__(self) -> int:
        return id(self.value)


class ObjectMemory:
    """The attributes of some behaviours, but for those that every behaviour has.

    Lists, dictionaries, sets and objects of other classes are copied with all that is in them; one that is in two places
    is in both again when it is put back. Nodes of the tree, ports, functions and classes are kept as they are.

    Args:
        behaviours: The behaviours.
        tree: All behaviours of the tree.

    Attributes:
        dated: Those that remembered a moment of the tick in hand when that was taken last.
    """

    def __init__(self, behaviours: Iterable[Behaviour], tree: Iterable[Behaviour]) -> None:
        self._behaviours = tuple(behaviours)
        self._tree = frozenset(tree)
        self.dated: list[Behaviour] = []
        # py_trees' blackboard is the process's, and part of what they remember if one of them looks at it.
        self._looks = any(behaviour.blackboards for behaviour in self._behaviours)

    def taken(self) -> Hashable:
        """Return what they remember now.

        Raises:
            UnkeepableError: If something of it can neither be copied nor compared; names the attribute and the class.
        """
        taking = _Taking(self._tree)
        self.dated = []
        attributes = []
        for behaviour in self._behaviours:
            taking.is_dated = False
            attributes.append(taking.attributes(behaviour))
            if taking.is_dated:
                self.dated.append(behaviour)
        taking.is_dated = False
        shared = self._shared(taking)
        if taking.is_dated:
            self.dated = list(self._behaviours)
        return tuple(attributes), shared

    def _shared(self, taking: "_Taking") -> Hashable:
        return taking.of(tuple(sorted(Blackboard.storage.items())) if self._looks else ())

    def snapshot(self, generator: object) -> Hashable | None:
        """Return all that a tick in the middle of a behaviour's own `tick` depends on; None if that cannot be said.

        Args:
            generator: The `tick`, which pauses.
        """
        try:
            taken, moments = self._snapshot(generator, {})
            if len(moments) > 1:
                # Which of two moments is the later one makes a difference, and not how many there were.
                order = {number: place for place, number in enumerate(sorted(moments))}
                taken, _ = self._snapshot(generator, order)
        except Exception:  # noqa: BLE001 - whatever stands in the way of a copy
            return None
        return taken

    def _snapshot(self, generator: object, order: Mapping[int, int]) -> tuple[Hashable, set[int]]:
        taking = _Taking(self._tree, order)
        own = tuple(taking.attributes(each) for each in self._behaviours)
        return (own, self._shared(taking), taking.of(generator)), taking.moments

    def put_back(self, taken: Any) -> None:
        """Have them remember what was taken."""
        putting, (attributes, shared) = _PuttingBack(), taken
        for behaviour, held in zip(self._behaviours, attributes, strict=True):
            putting.attributes(behaviour, held)
        if self._looks:
            Blackboard.storage.clear()
            Blackboard.storage.update(putting.value(shared))

    def values(self) -> dict[str, object]:
        """Return what they remember now, by the names of the behaviour and the attribute: `Recover.attempts`."""
        return {
            f"{behaviour.name}.{name}": value
            for behaviour in self._behaviours
            for name, value in vars(behaviour).items()
            if name not in _COMMON
        }

    def difference(self, first: Any, second: Any) -> str:
        """Return where two of what was taken differ, in words; empty where they do not."""
        for behaviour, one, other in zip(self._behaviours, first[0], second[0], strict=True):
            before, after = dict(one), dict(other)
            for name in sorted({*before, *after}):
                if before.get(name) != after.get(name):
                    values = [_PuttingBack().shown(each.get(name)) for each in (before, after)]
                    return f"the attribute '{name}' of '{behaviour.name}' ({class_of(behaviour)}) was {' and '.join(values)}"
        return ""


def class_of(value: object) -> str:
    """Return the name of an object's class, with its module."""
    cls = type(value)
    return f"{cls.__module__}.{cls.__qualname__}"


class _Taking:
    """Takes what is remembered at one time; what can be changed gets a number when it is met first.

    Args:
        tree: The behaviours of the tree.
        order: The places of moments by their numbers. With this, what is taken cannot be put back, generators can be taken, and
            nothing grows old.

    Attributes:
        is_dated: Whether there was a moment of the tick in hand in it.
        moments: The numbers of the moments of the tick in hand in it.
    """

    def __init__(self, tree: frozenset[Behaviour], order: Mapping[int, int] | None = None) -> None:
        self.is_dated = False
        self.moments: set[int] = set()
        self._order = order
        self._tree = tree
        self._numbers: dict[int, int] = {}
        # As long as these live, no other object has the identity of one of them.
        self._met: list[object] = []

    def attributes(self, behaviour: Behaviour) -> tuple[tuple[str, Hashable], ...]:
        """Return the attributes of a behaviour, by their names."""
        own = sorted((name, value) for name, value in vars(behaviour).items() if name not in _COMMON)
        return tuple((name, self._attribute(behaviour, name, value)) for name, value in own)

    def _attribute(self, behaviour: Behaviour, name: str, value: object) -> Hashable:
        try:
            return self.of(value)
        except UndecidableError:
            raise
        except Exception as error:
            message = (
                f"'{behaviour.name}' is a {class_of(behaviour)}, whose attribute '{name}' is a {type(value).__name__}, "
                f"which can neither be copied nor compared ({error}); let it hold numbers, texts, lists and the like, "
                "and make what only a robot has in setup(), which is not called here"
            )
            raise UnkeepableError(message) from error

    def of(self, value: Any) -> Hashable:
        """Return a value so that it can be compared and put back."""
        unchangeable = self._unchangeable(type(value), value)
        if unchangeable is not None:
            return unchangeable
        number = self._numbers.setdefault(id(value), len(self._met))
        if number < len(self._met):
            return _AGAIN, number
        self._met.append(value)
        return self._changeable(type(value), value, number)

    def _unchangeable(self, kind: Any, value: Any) -> Hashable | None:
        """Return a value that cannot be changed; None if it can be, as far as is known."""
        if kind in PLAIN or isinstance(value, _IMMUTABLE):
            return _SAME, kind, value
        if kind is float:
            return _FLOAT, "nan" if math.isnan(value) else value, math.copysign(1.0, value)
        if kind is tuple or kind is frozenset:
            return _FIXED, kind, kind(map(self.of, value))
        if isinstance(value, _ELSEWHERE) or (isinstance(value, Behaviour) and value in self._tree):
            return _KEPT, Identity(value), None
        return self._time(kind, value) if isinstance(value, PossibleTime) else None

    def _time(self, kind: type, value: PossibleTime) -> Hashable:
        if self._order is not None:
            if value.number:
                self.moments.add(value.number)
            place = bool(value.number), self._order.get(value.number or 0)
            return _TIME, kind, value.asker, value.shift, value.known, place
        self.is_dated |= value.grow_old()
        return _TIME, kind, value.asker, value.shift

    def _changeable(self, kind: type, value: Any, number: int) -> Hashable:
        """Return a value that may be changed, and that is met for the first time."""
        if kind in {list, deque, set}:
            items = (frozenset if kind is set else tuple)(map(self.of, value))
            return _ITEMS, number, kind, items, getattr(value, "maxlen", None)
        if kind is dict:
            return _DICT, number, tuple((self.of(key), self.of(held)) for key, held in value.items())
        if kind is types.FunctionType:
            cells = value.__closure__ or ()
            return _FUNCTION, number, Identity(value), tuple(self.of(cell.cell_contents) for cell in cells)
        if kind is types.MethodType:
            return _METHOD, Identity(value.__func__), self.of(value.__self__)
        if isinstance(value, Behaviour):
            # It is in no tree, so nobody else remembers its status.
            status = ("status", self.of(value.status))
            return _KEPT, Identity(value), (number, (*self.attributes(value), status))
        return self._made(value, number)

    def _made(self, value: Any, number: int) -> Hashable:
        """Return any other object as it would be copied: what makes it, of what, and what it is given then."""
        if self._order is not None and isinstance(value, types.GeneratorType):
            code, place, names, inside = held_by(value)
            return Identity(code), place, names, tuple([self.of(each) for each in inside])
        if self._order is not None and isinstance(value, types.CellType):
            return number, self.of(value.cell_contents)
        if isinstance(value, Output):
            return _KEPT, Identity(value), (number, (("value", self.of(value.value)),))
        recipe = value.__reduce_ex__(4)
        if isinstance(recipe, str):
            return _KEPT, Identity(value), None
        make, arguments, *state = recipe
        fields, items, entries = [*state, None, None, None][:3]
        return (
            _MADE, number, Identity(make), self.of(tuple(arguments)), self.of(fields),
            tuple(map(self.of, items or ())), tuple((self.of(key), self.of(held)) for key, held in entries or ()),
        )  # fmt: skip


class _PuttingBack:
    """Puts back what was taken at one time."""

    def __init__(self) -> None:
        self._made: dict[int, Any] = {}

    def attributes(self, behaviour: Behaviour, taken: Iterable[tuple[str, Any]]) -> None:
        """Give a behaviour its attributes; it loses what it did not have."""
        held = vars(behaviour)
        for name in [name for name in held if name not in _COMMON]:
            del held[name]
        held.update({name: self.value(value) for name, value in taken})

    def shown(self, taken: Any) -> str:
        """Return what was taken as a text; `nothing` for what is not there."""
        return "nothing" if taken is None else repr(self.value(taken))

    def value(self, taken: Any) -> Any:
        """Return what was taken."""
        how, *parts = taken
        return _WAYS[how](self, *parts)

    def _same(self, _kind: type, value: Any) -> Any:
        return value

    def _float(self, value: Any, _sign: float) -> float:
        return float(value)

    def _again(self, number: int) -> Any:
        return self._made[number]

    def _fixed(self, kind: Any, items: Iterable[Any]) -> Any:
        return kind(map(self.value, items))

    def _items(self, number: int, kind: Any, items: Iterable[Any], most: int | None) -> Any:
        made: Any = deque(maxlen=most) if kind is deque else kind()
        self._made[number] = made
        (made.update if kind is set else made.extend)(map(self.value, items))
        return made

    def _dict(self, number: int, entries: Iterable[tuple[Any, Any]]) -> Any:
        made: dict[Any, Any] = {}
        self._made[number] = made
        made.update((self.value(key), self.value(held)) for key, held in entries)
        return made

    def _function(self, number: int, function: Identity, contents: Iterable[Any]) -> Any:
        self._made[number] = function.value
        for cell, held in zip(function.value.__closure__ or (), contents, strict=True):
            cell.cell_contents = self.value(held)
        return function.value

    def _time(self, kind: Any, asker: Any, shift: float) -> Any:
        return kind(asker, shift)

    def _method(self, function: Identity, owner: Any) -> Any:
        return types.MethodType(function.value, self.value(owner))

    def _kept(self, kept: Identity, remembered: Any) -> Any:
        if remembered is not None:
            number, attributes = remembered
            self._made[number] = kept.value
            vars(kept.value).update({name: self.value(value) for name, value in attributes})
        return kept.value

    def _make(
        self, number: int, make: Identity, arguments: Any, fields: Any, items: Any, entries: Any
    ) -> Any:
        made = self._made[number] = make.value(*self.value(arguments))
        state = self.value(fields)
        if state is not None:
            _set_state(made, state)
        for item in items:
            made.append(self.value(item))
        for key, held in entries:
            made[self.value(key)] = self.value(held)
        return made


_WAYS: dict[int, Callable[..., Any]] = {
    _SAME: _PuttingBack._same,
    _FLOAT: _PuttingBack._float,
    _AGAIN: _PuttingBack._again,
    _FIXED: _PuttingBack._fixed,
    _ITEMS: _PuttingBack._items,
    _DICT: _PuttingBack._dict,
    _FUNCTION: _PuttingBack._function,
    _METHOD: _PuttingBack._method,
    _KEPT: _PuttingBack._kept,
    _MADE: _PuttingBack._make,
    _TIME: _PuttingBack._time,
}


def _set_state(made: Any, state: Any) -> None:
    """Give an object the state of another one, as `copy` does."""
    if hasattr(made, "__setstate__"):
        made.__setstate__(state)
        return
    fields, slots = state if isinstance(state, tuple) else (state, None)
    if fields:
        vars(made).update(fields)
    for name, value in (slots or {}).items():
        setattr(made, name, value)
