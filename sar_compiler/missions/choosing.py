"""Which mission a tree belongs to."""

from pathlib import Path

from sar_compiler.errors import SarError
from sar_compiler.missions.mission import Mission
from sar_compiler.nodes.binding.bound import Binding, BoundNode
from sar_compiler.nodes.binding.collector import Collector
from sar_compiler.nodes.installed import entry_points, import_installed
from sar_compiler.nodes.values import nearest
from sar_compiler.tree.diagnostic import TreeError

ENTRY_POINTS = "sar_compiler.missions"


class MissionError(SarError):
    """A mission cannot be loaded, or there is none of the name."""


def load_missions(checkout: Path | None = None) -> dict[str, Mission]:
    """Return the missions that are installed, by name.

    Args:
        checkout: A folder of which nothing counts as installed.

    Raises:
        MissionError: If one cannot be imported or is none, or if two have the same name.
    """
    missions: dict[str, Mission] = {}
    for entry_point in entry_points(ENTRY_POINTS, checkout):
        source = f"the mission '{entry_point.value}' (entry point '{entry_point.name}')"
        try:
            mission = getattr(import_installed(entry_point.module, checkout), entry_point.attr)
        except (Exception, SystemExit) as error:  # whatever a module does when it is imported
            message = f"{source} cannot be imported: {type(error).__name__}: {error}"
            raise MissionError(message) from error
        if not isinstance(mission, Mission):
            message = f"{source} is no Mission, but {mission!r}"
            raise MissionError(message)
        if missions.setdefault(mission.name, mission) is not mission:
            message = f"two missions are installed as '{mission.name}'; {source} is the second"
            raise MissionError(message)
    return missions


def mission_named(name: str, checkout: Path | None = None) -> Mission:
    """Return the mission that a user means.

    Args:
        name: Its name.
        checkout: A folder of which nothing counts as installed.

    Raises:
        MissionError: If none is called so.
    """
    missions = load_missions(checkout)
    if name in missions:
        return missions[name]
    near = nearest(name, missions)
    hint = f"; did you mean '{near}'?" if near else ""
    message = f"there is no mission '{name}' (installed: {', '.join(sorted(missions))}){hint}"
    raise MissionError(message)


def choose_mission(binding: Binding, name: str | None = None, checkout: Path | None = None) -> Mission | None:
    """Return the mission of a bound tree: the one whose context objects its leaves ask for.

    Args:
        binding: The tree.
        name: The mission that counts, whatever they ask for.
        checkout: A folder of which nothing counts as installed.

    Returns:
        None for a plain tree, whose leaves ask for no mission's.

    Raises:
        MissionError: If no mission is called *name*.
        TreeError: If the leaves ask for those of several missions.
    """
    if name is not None:
        return mission_named(name, checkout)
    missions = list(load_missions(checkout).values())
    first: dict[Mission, BoundNode] = {}
    for bound in binding.nodes():
        asked = {parameter.target for parameter in bound.spec.handed_over}
        for mission in missions:
            if not asked.isdisjoint(mission.context_types):
                first.setdefault(mission, bound)
    if len(first) > 1:
        collector = Collector()
        whose = ", ".join(f"<{bound.spec.tag}> of '{mission.name}'" for mission, bound in first.items())
        message = f"the leaves of this tree are of several missions: {whose}"
        last = list(first.values())[-1]
        collector.tag(last.element, "several-missions", message, hint="say which one counts: --mission NAME")
        raise TreeError(collector.findings)
    return next(iter(first), None)
