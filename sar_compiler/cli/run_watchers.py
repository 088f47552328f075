"""Those outside who watch a run of `sar-run`; what they take is imported only where they are asked for."""

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from typing import TYPE_CHECKING

from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.cli.run import Options
    from sar_compiler.monitoring.groot2_publisher import Groot2Publisher
    from sar_compiler.ros.engine import Engine


class RunWatchers:
    """Those who watch a run.

    Args:
        options: The options of the command line.
        node: The run's node.
        stack: Ends what they have begun.
    """

    def __init__(self, options: "Options", node: "Node", stack: ExitStack) -> None:
        self._options, self._node, self._stack = options, node, stack
        self._groot2: Groot2Publisher | None = None

    def show(self, tree: CompiledTree) -> None:
        """Take the tree that is to be run.

        Raises:
            SarError: If somebody cannot be shown it.
        """
        if self._options.groot2 is not None:
            self._groot2 = self._stack.enter_context(closing(self._published(tree, self._options.groot2)))

    def _published(self, tree: CompiledTree, port: int) -> "Groot2Publisher":
        from sar_compiler.monitoring.groot2_publisher import Groot2Publisher, PortError

        hooks, tell = self._options.groot2_hooks, self._node.get_logger().warning
        try:
            return Groot2Publisher(tree, port, hooks=hooks, tell=tell)
        except PortError as error:
            message = f"--groot2: {error}"
            raise SarError(message) from error

    def begin(self, engine: "Engine") -> None:
        """Watch what ticks the tree."""
        if self._groot2 is not None:
            self._groot2.watch(engine)


@contextmanager
def open_watchers(options: "Options", node: "Node") -> Iterator[RunWatchers]:
    """Let those watch a run who are asked for on the command line."""
    with ExitStack() as stack:
        yield RunWatchers(options, node, stack)
