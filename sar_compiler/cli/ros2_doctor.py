"""The check and the report that this project adds to `ros2 doctor`.

They show whether everything that a mission needs is installed.

The check examines the installed files. It also observes the ROS graph for one second, to find conflicting sources. To check that a robot
is ready for a tree, use `ros2 mission run TREE --check`.
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.metadata import version

from ros2doctor.api import DoctorCheck, DoctorReport, Report, Result
from ros2doctor.api.format import doctor_error, doctor_warn

from sar_compiler.commands import INTERFACES, missing_library_message
from sar_compiler.errors import SarError
from sar_compiler.missions.mission_choice import load_missions
from sar_compiler.runtime import kernel

_CATEGORY = "mission"


class MissionCheck(DoctorCheck):
    """A check of whether missions can be run on this machine."""

    def category(self) -> str:
        """Return the category under which `ros2 doctor` lists this project's results."""
        return _CATEGORY

    def check(self) -> Result:
        """Report and count missing packages, invalid missions and conflicting sources."""
        result = Result()
        loads: list[Callable[[], object]] = [partial(import_module, package) for package in INTERFACES]
        for load in [*loads, load_missions]:
            if reason := _loading_error(load):
                doctor_error(f"sar_compiler: {reason}")
                result.add_error()
        if not result.error:
            from sar_compiler.ros.graph_check import find_conflicts

            for line in find_conflicts():
                doctor_error(f"sar_compiler: {line}")
                result.add_error()
        if not kernel.IS_COMPILED:
            doctor_warn(
                f"sar_compiler: trees are ticked by {kernel.describe()}. This is several times slower than the compiled kernel"
            )
            result.add_warning()
        return result


class MissionReport(DoctorReport):
    """Versions of the software that runs missions."""

    def category(self) -> str:
        """Return the category under which `ros2 doctor` lists this project's results."""
        return _CATEGORY

    def report(self) -> Report:
        """Report versions, the kernel, and the installed missions."""
        report = Report("MISSION")
        for package in ("sar_compiler", "py_trees"):
            report.add_to_report(package, version(package))
        report.add_to_report("kernel", kernel.describe())
        try:
            missions = ", ".join(load_missions())
        except SarError as error:
            missions = str(error)
        report.add_to_report("missions", missions or "none")
        return report


def _loading_error(load: Callable[[], object]) -> str:
    """Call *load*, and return the error message if the call fails; otherwise return an empty string."""
    try:
        load()
    except ImportError as error:
        return missing_library_message(error) or str(error)
    except SarError as error:
        return str(error)
    return ""
