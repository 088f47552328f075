"""Functions to tick, stop and inspect a tree in flat form outside a search."""

from typing import Any

from sar_compiler.runtime.kernel.cells import INVALID
from sar_compiler.runtime.kernel.tree import FlatTree
from sar_compiler.runtime.kernel.tree_nodes import Ticker

Cells = tuple[tuple[int, ...], tuple[Any, ...]]


def tick(flat: FlatTree, ticker: Ticker) -> int:
    """Tick the root once and return the number of its outcome."""
    try:
        return ticker.run(flat.nodes[0])
    finally:
        flat.copy_shared_statuses(ticker)


def stop(flat: FlatTree, ticker: Ticker, index: int = 0) -> None:
    """Stop a node as `Behaviour.stop(Status.INVALID)` does; by default the root."""
    flat.nodes[index].stop(ticker)
    flat.copy_shared_statuses(ticker)


def put_to_rest(flat: FlatTree, ticker: Ticker, index: int) -> None:
    """Reset the status of a node that is not running."""
    ticker.cells[flat.nodes[index].status_cell] = INVALID
    flat.copy_shared_statuses(ticker)


def cells_of(ticker: Ticker) -> Cells:
    """Return the contents of the cells."""
    return tuple(ticker.cells), tuple(ticker.values)
