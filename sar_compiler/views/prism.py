"""The states of a tree as PRISM's explicit files, for a second opinion by PRISM, Storm or a program of one's own.

A tick is a choice of a Markov decision process, with one outcome of probability 1.
"""

import re
from array import array
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import NamedTuple

from sar_compiler.checks.verify.state_space import StateSpace
from sar_compiler.views.plain import plain, value_as_script

# What a name in PRISM's language cannot be.
_RESERVED = (
    "A bool clock const ctmc C double dtmc E endinit endinvariant endmodule endobservables endrewards endsystem "
    "false filter formula func F global G I init int invariant label max mdp min module nondeterministic "
    "observable observables of P Pmax Pmin pomdp popta prob probabilistic pta R rate rewards Rmax Rmin S "
    "stochastic system true U W X"
)
_NOTHING = value_as_script(None)
_INTEGER = re.compile(r"-?\d{1,9}")


class Variable(NamedTuple):
    """A fact or a key of the tree, as a column of the file of states.

    Attributes:
        name: What it is called there.
        source: The fact or the key.
        codes: The number of each of its values, which are texts as in a script; empty if these stand there themselves.
    """

    name: str
    source: str
    codes: Mapping[str, int]

    def shown(self, value: str) -> str:
        """Return the number or text that encodes a value."""
        return str(self.codes[value]) if self.codes else value


class PrismModel:
    """A state space in PRISM's explicit form.

    Args:
        space: The states and ticks.

    Attributes:
        variables: The facts and keys. `state` stands before them, a state's own number.
    """

    def __init__(self, space: StateSpace) -> None:
        self._space = space
        self._graph = space.graph
        self._count = len(space.graph.states)
        # Few rows are different: what else a state has is which nodes are running.
        rows: dict[tuple[tuple[str, str], ...], int] = {}
        self._row = array("I", (rows.setdefault(self._values(n), len(rows)) for n in range(self._count)))
        self._rows = [dict(row) for row in rows]
        names, take = dict.fromkeys(name for row in self._rows for name in row), _identifiers({"state"})
        self.variables = tuple(Variable(take(name), name, self._codes(name)) for name in names)

    def _values(self, state: int) -> tuple[tuple[str, str], ...]:
        values = self._space.values(state).items()
        return tuple((name, value_as_script(plain(value))) for name, value in values)

    def _codes(self, name: str) -> dict[str, int]:
        """Return the numbers of a column's values; none if all are truth values, or all whole numbers."""
        values = dict.fromkeys(row.get(name, _NOTHING) for row in self._rows)
        if values.keys() <= {"true", "false"} or all(_INTEGER.fullmatch(value) for value in values):
            return {}
        return {value: number for number, value in enumerate(values)}

    def states(self) -> Iterator[str]:
        """Yield the lines of the file of states, `.sta`."""
        yield f"({','.join(['state', *(variable.name for variable in self.variables)])})\n"
        rows = [
            "".join(f",{each.shown(row.get(each.source, _NOTHING))}" for each in self.variables)
            for row in self._rows
        ]
        yield from (f"{state}:({state}{rows[row]})\n" for state, row in enumerate(self._row))

    def transitions(self) -> Iterator[str]:
        """Yield the lines of the file of transitions, `.tra`; a state without ticks has one to itself."""
        count = sum(len(self._graph.edges(state)) or 1 for state in range(self._count))
        yield f"{self._count} {count} {count}\n"
        for state in range(self._count):
            targets = list(self._graph.successors(state)) or [state]
            yield from (f"{state} {choice} {target} 1\n" for choice, target in enumerate(targets))

    def labels(self) -> Iterator[str]:
        """Yield the lines of the file of labels, `.lab`."""
        labels = self._labels()
        yield " ".join(f'{number}="{name}"' for number, name in enumerate(labels)) + "\n"
        for state in range(self._count):
            numbers = [str(number) for number, holds in enumerate(labels.values()) if holds(state)]
            if numbers:
                yield f"{state}: {' '.join(numbers)}\n"

    def _labels(self) -> dict[str, Callable[[int], bool]]:
        """Return what says whether a state has a label, for each."""
        graph, take = self._graph, _identifiers(())
        labels: dict[str, Callable[[int], bool]] = {
            "init": lambda state: state == 0,
            "deadlock": lambda state: not graph.edges(state),
            "end": lambda state: bool(graph.ends[state]),
            "unexplored": lambda state: state >= graph.expanded,
            "error": lambda state: graph.error is not None and graph.error.source == state,
        }
        for rule, name in enumerate(self._space.rules):
            slug = take(name)
            breach = graph.breaches.get(rule)
            labels[f"breaks_{slug}"] = _is(None if breach is None else breach.source)
            if rule in self._space.owing:
                labels[f"owes_{slug}"] = self._owes(1 << rule)
        return labels

    def _owes(self, debt: int) -> Callable[[int], bool]:
        return lambda state: bool(self._graph.pending[state] & debt)


def _is(number: int | None) -> Callable[[int], bool]:
    return lambda state: state == number


def _identifiers(taken: Collection[str]) -> Callable[[str], str]:
    """Return what makes different identifiers of PRISM's language of names."""
    known = {*taken, *_RESERVED.split()}

    def take(name: str) -> str:
        plain_name = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "_"
        first = f"_{plain_name}" if plain_name[0].isdigit() else plain_name
        identifier, number = first, 2
        while identifier in known:
            identifier, number = f"{first}_{number}", number + 1
        known.add(identifier)
        return identifier

    return take
