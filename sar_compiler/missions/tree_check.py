"""Check that all leaves of a tree belong to the same mission."""

from sar_compiler.missions import ENTRY_POINTS
from sar_compiler.nodes.installed import entry_points
from sar_compiler.project.project_tree import ProjectTree
from sar_compiler.tree.diagnostic import Diagnostic, TreeError


def check_mission(tree: ProjectTree) -> list[Diagnostic]:
    """Return a finding if the leaves of the main tree belong to several missions.

    If the tree has errors, the result is empty.

    Raises:
        MissionError: If the mission that the user has named does not exist, or a mission cannot be imported.
    """
    project = tree.project
    # If only one mission is installed, the leaves cannot belong to several missions, so the mission need not be imported.
    if project.additions.mission is None and len(entry_points(ENTRY_POINTS, project.checkout)) < 2:  # noqa: PLR2004
        return []
    try:
        binding = tree.binding()
    except TreeError:  # the tree does not exist, or its errors are already reported
        return []
    from sar_compiler.missions.mission_choice import mission_of

    try:
        mission_of(tree, binding)
    except TreeError as error:
        return project.configuration.decide([*error.findings])
    return []
