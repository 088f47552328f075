"""Tests of the flat form of trees, against the traces of BehaviorTree.CPP."""

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from sar_compiler.runtime.clock import ManualClock
from sar_compiler.runtime.kernel.cells import SKIPPED, STATUSES
from sar_compiler.runtime.kernel.table import flatten
from sar_compiler.runtime.kernel.times import ClockTimes
from sar_compiler.runtime.kernel.tree import FlatTree
from sar_compiler.runtime.kernel.tree_nodes import Ticker
from tests.conformance.replay import Compiled, Seen, _runs, _ticks, cases_of, compile_case
from tests.runtime.kernel.flat import put_to_rest, stop, tick

FILES = sorted(Path(__file__).parent.glob("*.json"))


class FlatNode:
    """A node of a flat tree with the attributes of a behaviour that the replay uses.

    Args:
        flat: The tree.
        ticker: The ticker of the tree.
        index: The node's index.
    """

    def __init__(self, flat: FlatTree, ticker: Ticker, index: int = 0) -> None:
        self.flat = flat
        self.ticker = ticker
        self.index = index
        self.skipped = False
        self.setup = flat.nodes[index].behaviour.setup

    @property
    def status(self) -> Status:
        status: Status = STATUSES[self.ticker.cells[self.index]]
        return status

    @status.setter
    def status(self, status: Status) -> None:
        assert status == Status.INVALID
        put_to_rest(self.flat, self.ticker, self.index)

    def iterate(self) -> Iterator["FlatNode"]:
        index_of = {node.behaviour.id: node.index for node in self.flat.nodes}
        for behaviour in self.flat.nodes[0].behaviour.iterate():
            yield FlatNode(self.flat, self.ticker, index_of[behaviour.id])

    def tick_once(self) -> None:
        self.skipped = tick(self.flat, self.ticker) == SKIPPED

    def stop(self, status: Status) -> None:
        assert status == Status.INVALID
        stop(self.flat, self.ticker, self.index)


def as_py_trees(compiled: Compiled, clock: ManualClock) -> Compiled:
    return compiled


def in_flat_form(compiled: Compiled, clock: ManualClock) -> Compiled:
    flat = flatten(compiled.root)
    root: Any = FlatNode(flat, flat.ticker(ClockTimes(lambda _: clock)))
    return dataclasses.replace(compiled, root=root)


def traces(case: Any, form: Callable[[Compiled, ManualClock], Compiled]) -> list[list[Seen]]:
    """Return the ticks of a case's tree, run by run."""
    found = []
    for run in _runs(case):
        clock = ManualClock()
        compiled = compile_case(case["xml"], case.get("bb", {}), case.get("enums", {}), clock)
        found.append(list(_ticks(case, run, form(compiled, clock), clock)))
    return found


def is_accepted(case: Any) -> bool:
    try:
        compile_case(case["xml"], case.get("bb", {}), case.get("enums", {}), ManualClock())
    except Exception:  # noqa: BLE001 - whether a refusal is right is another test's question
        return False
    return True


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_flat_form_ticks_like_py_trees(path):
    cases = [case for case in cases_of(path) if is_accepted(case)]
    assert len(cases) > 0
    for case in cases:
        # Compared as strings, because NaN is not equal to itself.
        assert repr(traces(case, in_flat_form)) == repr(traces(case, as_py_trees)), case["name"]
