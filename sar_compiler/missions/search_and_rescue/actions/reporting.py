"""The common base of reporting a survivor and delivering kept reports: the call to the base station."""

from typing import Any

from py_trees.common import Status

from sar_compiler.missions.search_and_rescue.kept_reports import SurvivorReport
from sar_compiler.missions.search_and_rescue.record import MissionRecord
from sar_compiler.missions.search_and_rescue.zone_manager import MAP_FRAME
from sar_compiler.ros.leaves.service_leaf import ServiceLeaf


class ReportLeaf(ServiceLeaf):
    """A leaf that reports a survivor to the base station, and handles the acknowledgement.

    Subclasses choose the survivor.

    Args:
        record: Where the acknowledgement is noted.
        service: The service's name.
        server_timeout_sec: How long to wait for a server, seconds.
        timeout_sec: How long to wait for the answer, seconds.
    """

    service_type = "sar_interfaces/srv/ReportSurvivor"

    def __init__(
        self,
        name: str,
        record: MissionRecord | None,
        service: str,
        server_timeout_sec: float,
        timeout_sec: float,
    ) -> None:
        super().__init__(name)
        self.service_name = service
        self.server_timeout_sec = server_timeout_sec
        self.timeout_sec = timeout_sec
        self._record = record or MissionRecord()
        self._survivor_id = ""

    def on_send(self) -> None:
        """Note that the survivor is reported, and log the name."""
        self._record.report_sent(self._survivor_id)
        self.say(f"Reporting {self._survivor_id} to base...")

    def on_response(self, response: Any) -> Status:
        """Return SUCCESS if the base station has acknowledged the report, else FAILURE."""
        if not response.acknowledged:
            self.complain(f"Base did not acknowledge {self._survivor_id}.")
            return Status.FAILURE
        self._record.survivor_acknowledged(self._survivor_id)
        self.feedback_message = f"{self._survivor_id} acknowledged"
        self.say(f"Base acknowledged {self._survivor_id}.")
        return Status.SUCCESS

    def is_good_news(self, response: Any) -> bool:
        """Return whether the report was acknowledged."""
        return bool(response.acknowledged)

    def _request_for(self, report: SurvivorReport) -> Any:
        self._survivor_id = report.survivor_id
        request = self.interface.Request(survivor_id=report.survivor_id)
        request.location.header.frame_id = MAP_FRAME
        request.location.header.stamp = self.node.get_clock().now().to_msg()
        request.location.point.x, request.location.point.y = report.x, report.y
        return request
