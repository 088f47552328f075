"""The run extension of `--groot2`."""

from typing import TYPE_CHECKING

from sar_compiler.errors import SarError
from sar_compiler.groot2.groot2_publisher import Groot2Publisher
from sar_compiler.ros.run_extension import RunExtension

if TYPE_CHECKING:
    from sar_compiler.compiler import CompiledTree
    from sar_compiler.ros.engine import Engine


class Groot2Extension(RunExtension):
    """Serves a run's tree to Groot2.

    Args:
        port: The first of two consecutive TCP ports of this machine to use.
    """

    def __init__(self, port: int) -> None:
        self._port = port
        self._publisher: Groot2Publisher | None = None

    def on_compiled(self, tree: "CompiledTree", engine: "Engine") -> None:
        """Start responding to Groot2's requests.

        Raises:
            SarError: If a port cannot be used, or the tree has too many nodes for the protocol.
        """
        try:
            self._publisher = Groot2Publisher(tree, self._port)
            self._publisher.observe(engine)
        except SarError as error:
            raise SarError(f"--groot2: {error}") from error

    def on_end(self, *, has_begun: bool) -> None:  # noqa: ARG002 - the publisher also responds before the run begins
        """Stop responding to Groot2's requests."""
        if self._publisher is not None:
            self._publisher.close()
