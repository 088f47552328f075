"""What a mission is made of: the mission, its parameters, its journal, what is shown of it, and its servers.

This room has the interface (`mission`), the choice of a tree's mission (`choosing`), and how a run begins and ends; missions that ship
have a folder each.
"""

from typing import TYPE_CHECKING

from sar_compiler.faces import lazy

if TYPE_CHECKING:
    from sar_compiler.journal.journal import Journal
    from sar_compiler.journal.journal_entries import FACTS_LOST, RUN_BEGAN, RUN_ENDED, JournalEntry
    from sar_compiler.journal.situation import (
        Alarm,
        Display,
        FactTime,
        Figure,
        Gauge,
        Landmark,
        LandmarkKind,
        Level,
        MissionPhase,
        position,
    )
    from sar_compiler.missions.choosing import MissionError
    from sar_compiler.missions.mission import Mission, MissionRun, Verb, VerbField
    from sar_compiler.resources import shipped
    from sar_compiler.ros.arguments import readable_ros_errors
    from sar_compiler.ros.faults import FaultPlan, ServiceFaults, create_service
    from sar_compiler.ros.parameter_reader import ParameterError, ParameterReader, lookalikes
    from sar_compiler.ros.parameters import DataNode, flat_parameters
    from sar_compiler.ros.serving import serve
    from sar_compiler.runtime.context import mission_context
    from sar_compiler.tree.showing import short_line

__all__ = [
    "FACTS_LOST",
    "RUN_BEGAN",
    "RUN_ENDED",
    "Alarm",
    "DataNode",
    "Display",
    "FactTime",
    "FaultPlan",
    "Figure",
    "Gauge",
    "Journal",
    "JournalEntry",
    "Landmark",
    "LandmarkKind",
    "Level",
    "Mission",
    "MissionError",
    "MissionPhase",
    "MissionRun",
    "ParameterError",
    "ParameterReader",
    "ServiceFaults",
    "Verb",
    "VerbField",
    "create_service",
    "flat_parameters",
    "lookalikes",
    "mission_context",
    "position",
    "readable_ros_errors",
    "serve",
    "shipped",
    "short_line",
]

ENTRY_POINTS = "sar_compiler.missions"
"""The group of entry points by which missions are found."""
_MODULES = {
    "journal.journal": ("Journal",),
    "journal.journal_entries": ("FACTS_LOST", "JournalEntry", "RUN_BEGAN", "RUN_ENDED"),
    "journal.situation": (
        "Alarm",
        "Display",
        "FactTime",
        "Figure",
        "Gauge",
        "Landmark",
        "LandmarkKind",
        "Level",
        "MissionPhase",
        "position",
    ),
    "missions.choosing": ("MissionError",),
    "missions.mission": ("Mission", "MissionRun", "Verb", "VerbField"),
    "resources": ("shipped",),
    "ros.arguments": ("readable_ros_errors",),
    "ros.faults": ("FaultPlan", "ServiceFaults", "create_service"),
    "ros.parameter_reader": ("ParameterError", "ParameterReader", "lookalikes"),
    "ros.parameters": ("DataNode", "flat_parameters"),
    "ros.serving": ("serve",),
    "runtime.context": ("mission_context",),
    "tree.showing": ("short_line",),
}
_look_up, _names = lazy(__name__, _MODULES)
if not TYPE_CHECKING:
    __getattr__ = _look_up


def __dir__() -> list[str]:
    return [*globals(), *_names]
