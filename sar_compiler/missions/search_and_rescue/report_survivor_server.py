"""The service `report_survivor`: the base station, which acknowledges reports of survivors."""

import math
from typing import Any

from sar_interfaces.srv import ReportSurvivor

from sar_compiler.missions.search_and_rescue.zone_manager import MAP_FRAME
from sar_compiler.ros.faults import ServiceFaults, create_service
from sar_compiler.ros.parameters import DataNode
from sar_compiler.tree.showing import in_one_line, shortened


class ReportSurvivorServer(DataNode):
    """Acknowledges every report that is given in the frame `map`.

    One that comes again, because its sender has not had the answer, is acknowledged again and counts once.

    Args:
        faults: The faults to inject.
        options: Keyword arguments of `DataNode`: `context`, `cli_args` and so on.

    Raises:
        RosArgumentError: If a name or a value in its arguments is not allowed for a node.
    """

    def __init__(self, faults: ServiceFaults | None = None, **options: Any) -> None:
        super().__init__("report_survivor_server", **options)
        self._received: set[str] = set()
        create_service(
            self, ReportSurvivor, "report_survivor", self._answer, refuse=self._refuse, faults=faults
        )
        self.get_logger().info("ReportSurvivor service ready.")

    def _answer(self, request: Any, response: Any) -> Any:
        frame = request.location.header.frame_id
        if frame != MAP_FRAME:
            self.get_logger().warning(
                f"Report of {_told(request)} refused: it is in frame '{_shown(frame)}', and must be in '{MAP_FRAME}'."
            )
            response.acknowledged = False
            return response
        point = request.location.point
        if not (math.isfinite(point.x) and math.isfinite(point.y)):
            return self._refuse(request, response)
        response.acknowledged = True
        if _told(request) in self._received:
            self.get_logger().info(f"Report received again: {_told(request)}. Acknowledged.")
            return response
        self._received.add(_told(request))
        self.get_logger().info(f"Report received: {_told(request)}. Acknowledged.")
        self.get_logger().info(f"The point of {_shown(request.survivor_id)} is in frame '{frame}'.")
        return response

    def _refuse(self, request: Any, response: Any) -> Any:
        self.get_logger().warning(f"Report of {_told(request)} refused.")
        response.acknowledged = False
        return response


def _told(request: Any) -> str:
    point = request.location.point
    return f"{_shown(request.survivor_id)} at ({point.x:.2f}, {point.y:.2f})"


def _shown(text: str) -> str:
    """Return a text of somebody else's as the log may have it."""
    return in_one_line(shortened(text))
