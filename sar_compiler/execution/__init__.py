"""Mission runs, from the tree file to the result."""

from typing import TYPE_CHECKING

from sar_compiler.lazy_exports import lazy

if TYPE_CHECKING:
    from sar_compiler.execution.python_run import run_mission as run_mission
    from sar_compiler.execution.run_options import RunOptions as RunOptions
    from sar_compiler.execution.run_options import RunOutcome as RunOutcome
    from sar_compiler.execution.until import Until as Until

PUBLIC_MODULES = (
    "command_authors",
    "command_client",
    "extensions",
    "mission_run",
    "run_options",
    "run_setup",
    "run_view",
    "run_watch",
    "serve",
    "sim_isolation",
    "supervision",
    "supervisor",
    "until",
)
"""The modules of this package that other packages may import."""
if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
