"""The base classes of missions, and functions for the parameters, events, displays and servers of missions.

This package contains the interface of missions (`mission`), the choice of a tree's mission (`mission_choice`), and the start of a run
(`mission_start`).
"""

from typing import TYPE_CHECKING

from sar_compiler.lazy_exports import lazy

if TYPE_CHECKING:
    from sar_compiler.console_command import console_command as console_command
    from sar_compiler.journal.display import Alarm as Alarm
    from sar_compiler.journal.display import Display as Display
    from sar_compiler.journal.display import EventTime as EventTime
    from sar_compiler.journal.display import Figure as Figure
    from sar_compiler.journal.display import Gauge as Gauge
    from sar_compiler.journal.display import Landmark as Landmark
    from sar_compiler.journal.display import LandmarkKind as LandmarkKind
    from sar_compiler.journal.display import Level as Level
    from sar_compiler.journal.display import MissionPhase as MissionPhase
    from sar_compiler.journal.display import RasterLayer as RasterLayer
    from sar_compiler.journal.display import position as position
    from sar_compiler.journal.journal import Journal as Journal
    from sar_compiler.journal.journal_entries import BATTERY as BATTERY
    from sar_compiler.journal.journal_entries import FACTS_LOST as FACTS_LOST
    from sar_compiler.journal.journal_entries import OF_EVERY_MISSION as OF_EVERY_MISSION
    from sar_compiler.journal.journal_entries import PROGRESS as PROGRESS
    from sar_compiler.journal.journal_entries import RUN_BEGAN as RUN_BEGAN
    from sar_compiler.journal.journal_entries import RUN_ENDED as RUN_ENDED
    from sar_compiler.journal.journal_entries import CommandAuthor as CommandAuthor
    from sar_compiler.journal.journal_entries import JournalEntry as JournalEntry
    from sar_compiler.missions.faults import FaultPlan as FaultPlan
    from sar_compiler.missions.faults import ServiceFaults as ServiceFaults
    from sar_compiler.missions.faults import create_service as create_service
    from sar_compiler.missions.json_files import JsonFile as JsonFile
    from sar_compiler.missions.mission import CommandField as CommandField
    from sar_compiler.missions.mission import Mission as Mission
    from sar_compiler.missions.mission import MissionRun as MissionRun
    from sar_compiler.missions.mission import OperatorCommand as OperatorCommand
    from sar_compiler.missions.mission import SearchedArea as SearchedArea
    from sar_compiler.missions.mission_choice import MissionError as MissionError
    from sar_compiler.missions.parameter_file import ParameterFileError as ParameterFileError
    from sar_compiler.missions.parameter_reader import ParameterError as ParameterError
    from sar_compiler.missions.parameter_reader import ParameterReader as ParameterReader
    from sar_compiler.missions.parameter_reader import lookalikes as lookalikes
    from sar_compiler.resources import shared_file_path as shared_file_path
    from sar_compiler.ros.arguments import convert_ros_errors as convert_ros_errors
    from sar_compiler.ros.parameters import DataNode as DataNode
    from sar_compiler.ros.parameters import flat_parameters as flat_parameters
    from sar_compiler.ros.serving import serve as serve
    from sar_compiler.runtime.clock import clock_text as clock_text
    from sar_compiler.runtime.context import mission_context as mission_context
    from sar_compiler.tree.display_text import shorten_to_line as shorten_to_line

ENTRY_POINTS = "sar_compiler.missions"
"""The entry point group of installed missions."""
DEFAULT = "sar_compiler.default_mission"
"""The entry point group of the default mission."""
PUBLIC_MODULES = (
    "faults",
    "mission",
    "mission_choice",
    "mission_start",
    "parameter_file",
    "parameter_reader",
    "tree_check",
)
"""The modules that other packages may import."""
if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
