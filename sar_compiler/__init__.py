"""Write a mission as a tree file, have it checked, run it on ROS 2.

What is named here is public and kept::

    tree = sar_compiler.load("mission.xml")
    for finding in tree.check():
        print(finding.render())

So is `sar_compiler.testing`, for tests of trees. Every other module is the project's own, and changes with it.
Names are looked up when they are first used: to import this package takes no time, and needs no ROS.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sar_compiler.checks.verify.verdicts import ProofStatus, Verdict, Verification
    from sar_compiler.compiler import CompiledTree
    from sar_compiler.errors import SarError, UndecidableError
    from sar_compiler.journal.journal import Journal
    from sar_compiler.journal.journal_entries import JournalEntry
    from sar_compiler.journal.situation import Display, Figure, Landmark, LandmarkKind, Level
    from sar_compiler.missions.choosing import MissionError
    from sar_compiler.missions.mission import Mission, MissionRun
    from sar_compiler.missions.verbs import Verb, VerbField
    from sar_compiler.monitoring.groot2_publisher import Groot2Publisher
    from sar_compiler.nodes.constructors import RegistrationError
    from sar_compiler.nodes.register import register
    from sar_compiler.nodes.registry import Registry, RegistryError
    from sar_compiler.nodes.semantics import Semantics
    from sar_compiler.nodes.spec import Kind, Use
    from sar_compiler.nodes.values import Milliseconds, Seconds
    from sar_compiler.project import LoadedTree, load
    from sar_compiler.project.simulated import Simulated
    from sar_compiler.ros.arguments import readable_ros_errors
    from sar_compiler.ros.faults import FaultPlan, ServiceFaults, create_service
    from sar_compiler.ros.leaves.action_leaf import ActionLeaf
    from sar_compiler.ros.leaves.errors import LeafDefinitionError
    from sar_compiler.ros.leaves.leaf import RosLeaf
    from sar_compiler.ros.leaves.service_leaf import ServiceLeaf
    from sar_compiler.ros.leaves.topic_leaf import TopicLeaf
    from sar_compiler.ros.parameter_file import ParameterFileError
    from sar_compiler.ros.parameter_reader import ParameterError, ParameterReader
    from sar_compiler.ros.runner import TreeRunner
    from sar_compiler.ros.serving import serve
    from sar_compiler.runtime.answers import Answer
    from sar_compiler.runtime.clock import Clock, ManualClock
    from sar_compiler.runtime.context import mission_context
    from sar_compiler.runtime.kernel.searching import Progress
    from sar_compiler.runtime.kernel.user_nodes import Tick
    from sar_compiler.runtime.parents import Control, Decorator
    from sar_compiler.runtime.ports import InOut, Input, Output
    from sar_compiler.runtime.skipping import SKIPPED, SkippableLeaf
    from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError, UnreadableFileError

__all__ = [
    "SKIPPED",
    "ActionLeaf",
    "Answer",
    "Clock",
    "CompiledTree",
    "Control",
    "Decorator",
    "Diagnostic",
    "Display",
    "FaultPlan",
    "Figure",
    "Groot2Publisher",
    "InOut",
    "Input",
    "Journal",
    "JournalEntry",
    "Kind",
    "Landmark",
    "LandmarkKind",
    "LeafDefinitionError",
    "Level",
    "LoadedTree",
    "ManualClock",
    "Milliseconds",
    "Mission",
    "MissionError",
    "MissionRun",
    "Output",
    "ParameterError",
    "ParameterFileError",
    "ParameterReader",
    "Progress",
    "ProofStatus",
    "RegistrationError",
    "Registry",
    "RegistryError",
    "RosLeaf",
    "SarError",
    "Seconds",
    "Semantics",
    "ServiceFaults",
    "ServiceLeaf",
    "Severity",
    "Simulated",
    "SkippableLeaf",
    "Tick",
    "TopicLeaf",
    "TreeError",
    "TreeRunner",
    "UndecidableError",
    "UnreadableFileError",
    "Use",
    "Verb",
    "VerbField",
    "Verdict",
    "Verification",
    "create_service",
    "load",
    "mission_context",
    "readable_ros_errors",
    "register",
    "serve",
]

_MODULES = {
    "checks.verify.verdicts": ("ProofStatus", "Verdict", "Verification"),
    "compiler": ("CompiledTree",),
    "errors": ("SarError", "UndecidableError"),
    "journal.journal": ("Journal",),
    "journal.journal_entries": ("JournalEntry",),
    "journal.situation": ("Figure", "Landmark", "LandmarkKind", "Level", "Display"),
    "missions.choosing": ("MissionError",),
    "missions.mission": ("Mission", "MissionRun"),
    "missions.verbs": ("Verb", "VerbField"),
    "monitoring.groot2_publisher": ("Groot2Publisher",),
    "nodes.constructors": ("RegistrationError",),
    "nodes.register": ("register",),
    "nodes.registry": ("Registry", "RegistryError"),
    "nodes.semantics": ("Semantics",),
    "nodes.spec": ("Kind", "Use"),
    "nodes.values": ("Milliseconds", "Seconds"),
    "project": ("LoadedTree", "load"),
    "project.simulated": ("Simulated",),
    "ros.arguments": ("readable_ros_errors",),
    "ros.faults": ("FaultPlan", "ServiceFaults", "create_service"),
    "ros.leaves.action_leaf": ("ActionLeaf",),
    "ros.leaves.errors": ("LeafDefinitionError",),
    "ros.leaves.leaf": ("RosLeaf",),
    "ros.leaves.service_leaf": ("ServiceLeaf",),
    "ros.leaves.topic_leaf": ("TopicLeaf",),
    "ros.parameter_file": ("ParameterFileError",),
    "ros.parameter_reader": ("ParameterError", "ParameterReader"),
    "ros.runner": ("TreeRunner",),
    "ros.serving": ("serve",),
    "runtime.answers": ("Answer",),
    "runtime.clock": ("Clock", "ManualClock"),
    "runtime.context": ("mission_context",),
    "runtime.kernel.searching": ("Progress",),
    "runtime.kernel.user_nodes": ("Tick",),
    "runtime.parents": ("Control", "Decorator"),
    "runtime.ports": ("InOut", "Input", "Output"),
    "runtime.skipping": ("SKIPPED", "SkippableLeaf"),
    "tree.diagnostic": ("Diagnostic", "Severity", "TreeError", "UnreadableFileError"),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        message = f"module '{__name__}' has no attribute '{name}'"
        raise AttributeError(message, name=name)
    value = getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*globals(), *__all__]
