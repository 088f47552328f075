"""Loads tree files: reads, binds, checks and compiles them with the settings of the project.

A `Workspace` has the user's settings, creates a `Project` for each configuration that it finds, and loads tree files. All
commands and all tests of trees use a `Workspace`.
"""

from typing import TYPE_CHECKING

from sar_compiler.lazy_exports import lazy

if TYPE_CHECKING:
    from sar_compiler.project.command_line_settings import CommandLineSettings as CommandLineSettings
    from sar_compiler.project.project import Project as Project
    from sar_compiler.project.project_tree import ProjectTree as ProjectTree
    from sar_compiler.project.workspace import Workspace as Workspace

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
