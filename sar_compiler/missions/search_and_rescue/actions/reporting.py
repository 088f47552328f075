"""What reporting a survivor at once and delivering what was kept have in common: the call to the base station."""

from abc import abstractmethod
from typing import Any

from py_trees.common import Status

from sar_compiler.missions.search_and_rescue.frames import MAP_FRAME
from sar_compiler.missions.search_and_rescue.kept_reports import SurvivorReport
from sar_compiler.missions.search_and_rescue.record import MissionRecord
from sar_compiler.ros.leaves.service_call import CallDeadlines, Question, ServiceLeaf


class ReportLeaf(ServiceLeaf):
    """A leaf that reports a survivor to the base station, and heeds the acknowledgement.

    Subclasses say which survivor.

    Args:
        name: The node's name.
        record: Where the acknowledgement is noted.
        service: The service's name.
        deadlines: How long a call may take.
    """

    def __init__(
        self, name: str, record: MissionRecord | None, service: str, deadlines: CallDeadlines
    ) -> None:
        super().__init__(name, service, deadlines)
        self._record = record or MissionRecord()
        self._survivor_id = ""

    @abstractmethod
    def _next_report(self) -> SurvivorReport | None:
        """Return what to report now, or None if there is nothing."""

    def _service_type(self) -> Any:
        from sar_interfaces.srv import ReportSurvivor

        return ReportSurvivor

    def _ask(self) -> Question | None:
        report = self._next_report()
        if report is None:
            return None
        self._survivor_id = report.survivor_id
        request = self._service_type().Request(survivor_id=report.survivor_id)
        request.location.header.frame_id = MAP_FRAME
        request.location.header.stamp = self.node.get_clock().now().to_msg()
        request.location.point.x, request.location.point.y = report.x, report.y
        return Question(request, f"Reporting {report.survivor_id} to base...")

    def _is_good_news(self, answer: Any) -> bool:
        return bool(answer.acknowledged)

    def _conclude(self, answer: Any) -> Status:
        if not answer.acknowledged:
            self.complain(f"Base did not acknowledge {self._survivor_id}.")
            return Status.FAILURE
        self._record.survivor_acknowledged(self._survivor_id)
        self.feedback_message = f"{self._survivor_id} acknowledged"
        self.say(f"Base acknowledged {self._survivor_id}.")
        return Status.SUCCESS
