"""Leaves with ports of every direction, and with defaults of many types."""

from datetime import timedelta
from pathlib import Path

from py_trees.behaviour import Behaviour
from py_trees.common import OneShotPolicy, Status

from sar_compiler.leaves import Kind, register
from sar_compiler.runtime.ports import InOut, Input, Output


@register("Hear", kind=Kind.ACTION)
class Hear(Behaviour):
    """Hear something.

    Args:
        name: The node's name.
        heard: What was heard.
        anything: Whatever it is.
        volume: How loud.
        path: Where to.
        wait: How long.
        policy: When it is over.
        log: Where to write.
    """

    def __init__(
        self,
        name: str,
        heard: Output[str],
        anything: InOut,  # type: ignore[type-arg]
        volume: Input[float] | None = None,
        path: list[float] = [0.5, 1.0],  # noqa: B006 - a default is only read
        wait: timedelta = timedelta(milliseconds=1500),
        policy: OneShotPolicy = OneShotPolicy.ON_COMPLETION,
        log: Path = Path("out/log.txt"),
    ) -> None:
        super().__init__(name)
        self.given = (heard, anything, volume, path, wait, policy, log)

    def update(self) -> Status:
        return Status.SUCCESS
