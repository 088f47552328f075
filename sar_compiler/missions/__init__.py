"""What a mission is made of: the mission, its parameters, its journal, what is shown of it, and its servers.

This room has the interface (`mission`), the choice of a tree's mission (`choosing`), and how a run begins and ends; missions that ship
have a folder each.
"""

from typing import TYPE_CHECKING

from sar_compiler.faces import lazy

if TYPE_CHECKING:
    from sar_compiler.journal.journal import Journal
    from sar_compiler.journal.journal_entries import JournalEntry
    from sar_compiler.journal.situation import Display, Figure, Landmark, LandmarkKind, Level
    from sar_compiler.missions.choosing import MissionError
    from sar_compiler.missions.mission import Mission, MissionRun
    from sar_compiler.missions.verbs import Verb, VerbField
    from sar_compiler.ros.arguments import readable_ros_errors
    from sar_compiler.ros.faults import FaultPlan, ServiceFaults, create_service
    from sar_compiler.ros.parameter_reader import ParameterError, ParameterReader
    from sar_compiler.ros.serving import serve
    from sar_compiler.runtime.context import mission_context

__all__ = [
    "Display",
    "FaultPlan",
    "Figure",
    "Journal",
    "JournalEntry",
    "Landmark",
    "LandmarkKind",
    "Level",
    "Mission",
    "MissionError",
    "MissionRun",
    "ParameterError",
    "ParameterReader",
    "ServiceFaults",
    "Verb",
    "VerbField",
    "create_service",
    "mission_context",
    "readable_ros_errors",
    "serve",
]

ENTRY_POINTS = "sar_compiler.missions"
"""The group of entry points by which missions are found."""
_MODULES = {
    "journal.journal": ("Journal",),
    "journal.journal_entries": ("JournalEntry",),
    "journal.situation": ("Display", "Figure", "Landmark", "LandmarkKind", "Level"),
    "missions.choosing": ("MissionError",),
    "missions.mission": ("Mission", "MissionRun"),
    "missions.verbs": ("Verb", "VerbField"),
    "ros.arguments": ("readable_ros_errors",),
    "ros.faults": ("FaultPlan", "ServiceFaults", "create_service"),
    "ros.parameter_reader": ("ParameterError", "ParameterReader"),
    "ros.serving": ("serve",),
    "runtime.context": ("mission_context",),
}
_look_up, _names = lazy(__name__, _MODULES)
if not TYPE_CHECKING:
    __getattr__ = _look_up


def __dir__() -> list[str]:
    return [*globals(), *_names]
