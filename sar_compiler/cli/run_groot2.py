"""`--groot2` of `sar-run`."""

from typing import TYPE_CHECKING

from sar_compiler.cli.companions import RunSetup, errors_of
from sar_compiler.monitoring.groot2_publisher import Groot2Publisher
from sar_compiler.ros.companion import Companion

if TYPE_CHECKING:
    from sar_compiler.compiler import CompiledTree
    from sar_compiler.ros.engine import Engine


class RunGroot2(Companion):
    """Shows a run in Groot2.

    Args:
        port: The port of this machine; the next one is used as well.
        run: The run.
    """

    def __init__(self, port: int, run: RunSetup) -> None:
        self._port, self._run = port, run
        self._publisher: Groot2Publisher | None = None

    @errors_of("--groot2")
    def begin(self, tree: "CompiledTree", engine: "Engine") -> None:
        """Answer from here on.

        Raises:
            SarError: If the port cannot be had, or the tree is too large.
        """
        hooks, tell = self._run.options.groot2_hooks, self._run.node.get_logger().warning
        self._publisher = Groot2Publisher(tree, self._port, hooks=hooks, tell=tell)
        self._publisher.watch(engine)

    def end(self, *, has_begun: bool) -> None:  # noqa: ARG002 - it is answered from before that on
        """Answer nobody any more."""
        if self._publisher is not None:
            self._publisher.close()
