"""Find the mission to which a tree belongs."""

import functools
import traceback
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from sar_compiler.commands import missing_library_message
from sar_compiler.errors import SarError
from sar_compiler.missions import DEFAULT, ENTRY_POINTS
from sar_compiler.nodes.binding.bound import Binding, BoundNode
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.installed import entry_points, ignored_entry_points, import_installed
from sar_compiler.project.project_tree import ProjectTree
from sar_compiler.runtime.blackboard import Scope
from sar_compiler.runtime.clock import Clock
from sar_compiler.runtime.variables import Enums
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.guessing import did_you_mean, nearest

if TYPE_CHECKING:
    from sar_compiler.missions.mission import Mission, MissionRun

# The types of context objects that every tree has, with or without a mission.
_OF_EVERY_TREE = {Clock, Enums, Scope}


class MissionError(SarError):
    """A mission does not exist, cannot be loaded, or has raised an exception."""


class _GuardedMission:
    """Wraps a mission or a mission's run, so that an exception in a method names the mission."""

    def __init__(self, guarded: "Mission | MissionRun", name: str) -> None:
        self._guarded = guarded
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        value = getattr(self._guarded, attribute)
        return functools.partial(self._call, value) if callable(value) else value

    def _call(self, method: Callable[..., object], *arguments: object, **options: object) -> object:
        failed = f"the mission '{self._name}' failed in {method.__name__}"
        try:
            result = method(*arguments, **options)
        except SarError:
            raise
        except Exception as error:
            # A missing library is not an error of the mission. The command's message names the extra that provides the library.
            if isinstance(error, ImportError) and missing_library_message(error):
                raise
            place = traceback.extract_tb(error.__traceback__)[-1]
            message = f"{failed}: {type(error).__name__}: {error} ({place.filename}:{place.lineno})"
            raise MissionError(message) from error
        if method.__name__ != "begin":
            return result
        from sar_compiler.missions.mission import MissionRun

        if not isinstance(result, MissionRun):
            raise MissionError(f"{failed}: the method returned {result!r} instead of a MissionRun")
        return _GuardedMission(result, self._name)


def load_missions(checkout: Path | None = None) -> "dict[str, Mission]":
    """Return the installed missions by name.

    Raises:
        MissionError: If an entry point cannot be imported or is not a mission, or if two missions have the same name.
    """
    missions: dict[str, Mission] = {}
    for entry_point in entry_points(ENTRY_POINTS, checkout):
        source = f"the mission '{entry_point.value}' (entry point '{entry_point.name}')"
        try:
            mission = getattr(import_installed(entry_point.module, checkout), entry_point.attr)
        except (Exception, SystemExit) as error:  # a module can raise any exception when it is imported
            raise MissionError(f"{source} cannot be imported: {type(error).__name__}: {error}") from error
        problem = _find_problem(mission)
        if problem:
            raise MissionError(f"{source} {problem}")
        if missions.setdefault(mission.name, mission) is not mission:
            raise MissionError(
                f"two installed missions have the name '{mission.name}'. One of them is {source}"
            )
    return missions


def default_mission() -> str | None:
    """Return the name of the default mission, or None. Its default tree runs if the user names no tree."""
    return next((entry_point.name for entry_point in entry_points(DEFAULT)), None)


def _find_problem(mission: object) -> str:
    """Return why the object of an entry point is not a valid mission, or an empty string if it is valid."""
    from sar_compiler.missions.mission import Mission

    if not isinstance(mission, Mission):
        return f"must name a Mission, but names {mission!r}"
    name = getattr(mission, "name", None)
    if not isinstance(name, str) or not (name.isascii() and name.isidentifier()):
        return f"must have a name that is valid for a node, such as 'patrol', but has {name!r}"
    types = mission.context_types
    if isinstance(types, Collection) and all(isinstance(each, type) for each in types):
        return ""
    return f"must have a collection of classes as context_types, but has {types!r}"


def find_mission(name: str, checkout: Path | None = None) -> "Mission":
    """Return a mission by its name.

    Raises:
        MissionError: If there is no mission of this name.
    """
    missions = load_missions(checkout)
    if name in missions:
        return missions[name]
    hint = did_you_mean(nearest(name, missions))
    for _, place in ignored_entry_points(ENTRY_POINTS, checkout)[:1]:
        hint += f". The missions in {place} are ignored, because this folder is being checked. Install these missions"
    raise MissionError(f"there is no mission '{name}' (installed: {', '.join(sorted(missions))}){hint}")


def choose_mission(
    binding: Binding, name: str | None = None, checkout: Path | None = None
) -> "Mission | None":
    """Return the mission whose context objects the leaves of a tree require.

    Args:
        binding: The tree, whose tags are bound to nodes.
        name: The name of the mission to use, regardless of the leaves; None to choose the mission by the
            leaves.
        checkout: A folder whose packages are not regarded as installed.

    Returns:
        The mission; None if the leaves require no context objects of a mission.

    Raises:
        MissionError: If there is no mission called *name*. The methods of the returned mission, and of the
            mission's run, also raise this error instead of other exceptions.
        TreeError: If the leaves require the context objects of several missions.
    """
    if name is not None:
        return _guard(find_mission(name, checkout))
    required_types = [
        (bound, {each.target for each in bound.spec.handed_over} - _OF_EVERY_TREE)
        for bound in binding.all_nodes()
    ]
    # If no leaf requires a context object of a mission, no mission is imported.
    missions = [*load_missions(checkout).values()] if any(types for _, types in required_types) else []
    first: dict[Mission, BoundNode] = {}
    for bound, types in required_types:
        for mission in missions:
            if not types.isdisjoint(mission.context_types):
                first.setdefault(mission, bound)
    if len(first) > 1:
        collector = FindingCollector()
        whose = ", ".join(f"<{bound.spec.tag}> of '{mission.name}'" for mission, bound in first.items())
        message = f"the leaves of this tree belong to several missions: {whose}"
        last = list(first.values())[-1]
        collector.add("several-missions", message, last.element, hint="choose one with --mission NAME")
        raise TreeError(collector.findings)
    return _guard(next(iter(first))) if first else None


def _guard(mission: "Mission") -> "Mission":
    return cast("Mission", _GuardedMission(mission, mission.name))


def mission_of(tree: ProjectTree, binding: Binding) -> "Mission | None":
    """Return the mission of a loaded tree, or None if the tree has no mission.

    Raises:
        MissionError, TreeError: See `choose_mission`.
    """
    return choose_mission(binding, tree.project.additions.mission, tree.project.checkout)
