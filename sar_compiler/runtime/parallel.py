"""Parallels that count: children side by side, until enough of them have ended.

Stock py_trees has policies for all children and for one of them, ticks every child before it decides, and ticks
children that have failed again.
"""

from collections.abc import Sequence

from py_trees.behaviour import Behaviour

from sar_compiler.errors import SarError
from sar_compiler.runtime.kernel.counting import ParallelAllNode, ParallelNode
from sar_compiler.runtime.parents import Control
from sar_compiler.runtime.ports import Input


class ThresholdError(SarError):
    """A parallel is to wait for more children than it has."""


class _Counting(Control):
    """Children side by side; one that has ended is not ticked again until the node has."""

    def _threshold(self, port: str, wanted: int) -> int:
        """Return how many children an attribute means; counted from the end if it is negative.

        Raises:
            ThresholdError: If they are more than there are.
        """
        count = len(self.children)
        if wanted > count:
            message = (
                f"'{self.name}' can never count {wanted} children, because it has {count}; "
                f"{port} is at most {count}, or negative to count from the end (-1: all)"
            )
            raise ThresholdError(message)
        return wanted if wanted >= 0 else max(count + wanted + 1, 0)


class Parallel(_Counting):
    """Succeeds after success_count successes; fails after failure_count failures or when success is out of reach.

    It decides after every child: the ones behind the child that decides are not ticked any more in that tick.
    Stock py_trees cannot count to anything but one and all.

    Args:
        success_count: How many successes make a success; negative: counted from the end, -1 is all, and then
            a skipped child counts as one that succeeded.
        failure_count: How many failures make a failure; negative: counted from the end.
    """

    node_class = ParallelNode

    def __init__(
        self,
        name: str,
        children: Sequence[Behaviour],
        success_count: Input[int] | None = None,
        failure_count: Input[int] | None = None,
    ) -> None:
        super().__init__(name, children)
        self._success_count = success_count or Input(-1)
        self._failure_count = failure_count or Input(1)


class ParallelAll(_Counting):
    """Waits for all children, then fails if too many of them have failed.

    Stock py_trees fails with the first child that does.

    Args:
        max_failures: With how many failures it fails; negative: counted from the end, 0: always.
    """

    node_class = ParallelAllNode

    def __init__(
        self, name: str, children: Sequence[Behaviour], max_failures: Input[int] | None = None
    ) -> None:
        super().__init__(name, children)
        self._max_failures = max_failures or Input(1)
