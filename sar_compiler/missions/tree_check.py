"""Whether the leaves of a tree are those of one mission."""

from sar_compiler.missions import ENTRY_POINTS
from sar_compiler.nodes.installed import entry_points
from sar_compiler.project.project_tree import ProjectTree
from sar_compiler.tree.diagnostic import Diagnostic, TreeError


def check_mission(tree: ProjectTree) -> list[Diagnostic]:
    """Return the findings about the mission of the tree that a file executes; none for a file with errors.

    Raises:
        MissionError: If there is no mission of the name that the user has given, or one cannot be imported.
    """
    project = tree.project
    # The only one is never imported to ask whose a tree is.
    if project.additions.mission is None and len(entry_points(ENTRY_POINTS, project.checkout)) < 2:  # noqa: PLR2004
        return []
    try:
        binding = tree.binding()
    except TreeError:  # there is no such tree, or it has been said already what is wrong with it
        return []
    from sar_compiler.missions.choosing import mission_of

    try:
        mission_of(tree, binding)
    except TreeError as error:
        return project.configuration.decide([*error.findings])
    return []
