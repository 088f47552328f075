"""The commands `sar-detect-survivor-server` and `sar-report-survivor-server`.

`serve` imports ROS, and reports an error if ROS is missing.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from sar_compiler.missions import serve

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.node import Node


DETECT = (
    "sar-detect-survivor-server",
    "Serve detect_survivor (sar_interfaces/srv/DetectSurvivor). The parameters survivors.<zone>.x and survivors.<zone>.y replace the default survivors.",
)
"""The name and the description of the command `sar-detect-survivor-server`."""
REPORT = (
    "sar-report-survivor-server",
    "Serve report_survivor (sar_interfaces/srv/ReportSurvivor). Reports with a position in the frame map are acknowledged.",
)
"""The name and the description of the command `sar-report-survivor-server`."""


def detect(argv: Sequence[str] | None = None) -> int:
    """Run `sar-detect-survivor-server` and return its exit status."""
    return serve(_detector, *DETECT, argv)


def report(argv: Sequence[str] | None = None) -> int:
    """Run `sar-report-survivor-server` and return its exit status."""
    return serve(_base, *REPORT, argv)


def _detector(context: "Context", arguments: list[str]) -> "Node":
    from search_and_rescue.servers import DetectSurvivorServer

    return DetectSurvivorServer(context=context, cli_args=arguments)


def _base(context: "Context", arguments: list[str]) -> "Node":
    from search_and_rescue.servers import ReportSurvivorServer

    return ReportSurvivorServer(context=context, cli_args=arguments)
