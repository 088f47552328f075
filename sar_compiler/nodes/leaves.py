"""Leaves that every tree may use, whatever its mission."""

from py_trees import behaviours

from sar_compiler.nodes.register import Registration
from sar_compiler.nodes.spec import Kind

REGISTRATIONS = [
    Registration("Success", behaviours.Success, Kind.ACTION, frozenset({"SUCCESS"}), doc="Succeeds."),
    Registration("Failure", behaviours.Failure, Kind.ACTION, frozenset({"FAILURE"}), doc="Fails."),
    Registration("Running", behaviours.Running, Kind.ACTION, frozenset({"RUNNING"}), doc="Runs for ever."),
    Registration("AlwaysSuccess", behaviours.Success, Kind.ACTION, frozenset({"SUCCESS"}), doc="Succeeds."),
    Registration("AlwaysFailure", behaviours.Failure, Kind.ACTION, frozenset({"FAILURE"}), doc="Fails."),
]
