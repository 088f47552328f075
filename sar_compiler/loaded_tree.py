"""A loaded tree file, which can be checked, compiled, simulated, verified, monitored and predicted from Python."""

import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from sar_compiler.analysis.tree_analysis import predict_tree, verify_tree
from sar_compiler.missions.tree_check import check_mission
from sar_compiler.nodes.registry import Named, Registry
from sar_compiler.project.command_line_settings import CommandLineSettings
from sar_compiler.project.project_tree import ProjectTree
from sar_compiler.project.workspace import Workspace
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.discovery import find_tree

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.analysis.simulated import Simulated
    from sar_compiler.compiler import CompiledTree


class LoadedTree(ProjectTree):
    """A tree file with its included files and the settings of its project. Create it with `load`."""

    def _repr_svg_(self) -> str | None:
        """Return a picture for a notebook. If the file is malformed, return None, and the notebook shows text."""
        from sar_compiler.views.drawing import svg

        try:
            return svg(self.sketch())
        except TreeError:
            return None

    def compile(
        self,
        *,
        node: "Node | None" = None,
        parameters: Mapping[str, object] | None = None,
        context: Mapping[type, object] | None = None,
        tree_id: str | None = None,
    ) -> "CompiledTree":
        """Compile a tree for ticking.

        Args:
            node: The ROS node that ticks the tree. It provides the tree's clock, and its parameters become keys of the root
                    blackboard. Without a node, the tree uses the steady clock.
            parameters: Further keys of the root blackboard, which override the node's parameters.
            context: Objects that leaves require in their constructors, by their type.
            tree_id: The ID of a tree in the file; by default the main tree.

        Raises:
            TreeError: If the file has errors, a key has no value or an invalid value, a leaf needs an object that is
                    not in *context*, or a constructor rejects its arguments.
        """
        if node is None:
            return super().compile(parameters=parameters, context=context, tree_id=tree_id)
        from sar_compiler.ros.clock import mission_clock
        from sar_compiler.ros.parameters import flat_parameters
        from sar_compiler.runtime.clock import Clock

        of_node = flat_parameters(node)
        clock: dict[type, object] = {Clock: mission_clock(node)}
        return super().compile(
            parameters={**of_node, **(parameters or {})},
            context={**clock, **(context or {})},
            tree_id=tree_id,
        )

    def simulate(
        self,
        *,
        leaves: Mapping[str, object] | None = None,
        scenario: Mapping[str, object] | None = None,
        **scripts: object,
    ) -> "Simulated":
        """Return the tree with scripted leaves, for ticking on a manual clock.

        The arguments correspond to the content of a scenario file, as Python lists and dictionaries.

        Args:
            leaves: The outcomes of leaves by path, name or tag, such as `{"Patrol/NavigateToZone": ["aborted", "arrived"]}`.
            scenario: The other keys of a scenario, such as `{"tree": "Main", "facts": {"zones_left": 1}, "period": "0.1s"}`.
            **scripts: The outcomes of leaves whose names are Python identifiers, such as `NavigateToZone=["aborted", "arrived"]`.

        Raises:
            TreeError: If the file has errors, or an argument contains an outcome that a leaf cannot have.
        """
        from sar_compiler.analysis.simulated import simulate_tree

        return simulate_tree(self, {**(scenario or {}), "leaves": {**(leaves or {}), **scripts}})

    verify = verify_tree
    predict = predict_tree


class _LoadingWorkspace(Workspace):
    """A workspace that loads tree files as `LoadedTree`."""

    def load(self, tree: str | Path) -> LoadedTree:
        path = find_tree(str(tree))
        return LoadedTree(path, self.project_of(path), self.read, self.report_once, [check_mission])


def load(
    tree: str | Path,
    *,
    nodes: Iterable[Named] = (),
    models: Iterable[str | Path] = (),
    include_path: Iterable[str | Path] = (),
    registry: Registry | None = None,
    mission: str | None = None,
    isolated: bool = False,
) -> LoadedTree:
    """Load a tree file, with the settings of its project's configuration.

    Args:
        tree: The path of a tree file, or the name of a shipped tree.
        nodes: Your own leaves: classes, modules, or import paths of modules.
        models: Palettes of nodes that are not installed: files, or names of shipped palettes, such as `nav2:jazzy`.
        include_path: Further folders for included files.
        registry: The known nodes; if given, the installed nodes, *nodes* and installed palettes are ignored.
        mission: The name of the mission; by default, the mission is determined from the requirements of the leaves.
        isolated: Whether to ignore the project's configuration, palettes and other trees.

    Raises:
        UnreadableFileError: If the file does not exist or cannot be read.
        TreeError: If the project's configuration has errors. Errors in the tree itself are returned by `check`, and raised by
                `compile`, `simulate` and `verify`.
        TypeError: If *nodes*, *models* or *include_path* is a single string.
    """
    for name, several in (("nodes", nodes), ("models", models), ("include_path", include_path)):
        if isinstance(several, str):
            raise TypeError(f"{name} is the string '{several}'. Pass a list of strings: {name}=['{several}']")
    palettes, folders = (tuple(Path(path) for path in each) for each in (models, include_path))
    additions = CommandLineSettings(
        tuple(nodes), palettes, folders, registry=registry, mission=mission, is_isolated=isolated
    )
    # The frames of `_note`, `project_of` and the two functions `load` are between the warning and the caller.
    return _LoadingWorkspace(additions, note=lambda text: warnings.warn(text, stacklevel=6)).load(tree)
