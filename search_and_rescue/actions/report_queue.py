"""Reports that could not be delivered: kept, and delivered when the base station answers again."""

import math
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

from py_trees.common import Status

from sar_compiler.leaves import (
    Answer,
    Clock,
    Kind,
    RosLeaf,
    Seconds,
    Use,
    WallClock,
    register,
)
from search_and_rescue.actions.survivors import DetectSurvivor, ReportLeaf, report_of
from search_and_rescue.record import KeptReports, MissionRecord, SurvivorReport

_LONGEST_BACKOFF_SEC = 60.0
_KEPT = "reports_kept += kept_by_{detect_node} ? 0 : 1; kept_by_{detect_node} = true"


class Backoff:
    """The pause after a failure: twice as long after each further one.

    Args:
        clock: The clock that it is measured with.
        first_sec: The pause after the first failure, seconds; 0 for none at all.
        longest_sec: The longest pause, seconds.
    """

    def __init__(self, clock: Clock, first_sec: float, longest_sec: float) -> None:
        self._clock = clock
        self._first_sec, self._longest_sec = first_sec, max(first_sec, longest_sec)
        self._pause_sec = 0.0
        self._since = -math.inf

    @property
    def left_sec(self) -> float:
        """Seconds of the pause that are left; 0 or less if it is over."""
        elapsed = self._clock.now() - self._since
        # A clock that jumps back, as that of a simulator which starts anew, ends the pause.
        return self._pause_sec - elapsed if elapsed >= 0.0 else 0.0

    def failed(self) -> None:
        """Begin a pause."""
        self._pause_sec = min(self._pause_sec * 2 or self._first_sec, self._longest_sec)
        self._since = self._clock.now()

    def reset(self) -> None:
        """End the pauses: an attempt has succeeded."""
        self._pause_sec = 0.0


@register(
    "KeepReport",
    kind=Kind.ACTION,
    effects="keeps the report of the survivor for later",
    answers=(
        Answer("SUCCESS", "kept", "named_by_{detect_node}", _KEPT),
        Answer("FAILURE", "nothing to keep", "!named_by_{detect_node}"),
    ),
    facts={"reports_kept": 0, "named_by_{detect_node}": False, "kept_by_{detect_node}": False},
)
class KeepReport(RosLeaf):
    """Keep the report of the survivor that was found, for `DeliverReports`; FAILURE if there is none with a name.

    Args:
        detect_node: The search that found the survivor.
        record: Where it is noted that the report is kept.
    """

    def __init__(
        self, name: str, detect_node: DetectSurvivor, *, record: MissionRecord | None = None
    ) -> None:
        super().__init__(name)
        self._detect_node = detect_node
        self._record = record or MissionRecord()

    def update(self) -> Status:
        """Keep the report; to keep it again changes nothing."""
        report = report_of(self._detect_node, self, self._record, "no report to keep")
        if isinstance(report, Status):
            return report
        survivor_id = report.survivor_id
        self._record.report_kept(report)
        self.feedback_message = f"the report of {survivor_id} is kept"
        self.say(f"The report of {survivor_id} is kept until base acknowledges it.")
        return Status.SUCCESS


@register(
    "DeliverReports",
    kind=Kind.ACTION,
    effects="reports the survivors whose reports were kept",
    uses=(Use.service("{service}"),),
    answers=(
        Answer("SUCCESS", "nothing kept", "reports_kept == 0"),
        Answer("SUCCESS", "delivered", "reports_kept > 0", "reports_kept = 0"),
        Answer("FAILURE", "refused", "reports_kept > 0"),
        Answer("FAILURE", "all but one delivered", "reports_kept > 1", "reports_kept = 1"),
        Answer("RUNNING", "reporting", "reports_kept > 0"),
    ),
    facts={"reports_kept": 0},
)
@dataclass(eq=False, repr=False)
class DeliverReports(ReportLeaf):
    """Report each survivor whose report was kept: SUCCESS if none is left, at once if there was none.

    FAILURE if a report was refused, after all others were tried; or as soon as the base station gives no answer. With a
    back-off it is RUNNING for a while after a failure before it sends again: for `backoff_sec` at first, twice as long
    after each further failure, a minute at most. A report that was not among those tried is sent at once.

    Args:
        kept_reports: Where the reports are kept.
        record: Where acknowledgements are noted.
        clock: The clock of the back-off.
        timeout_sec: How long to wait for each answer, seconds.
        backoff_sec: How long to send nothing after the first failure, seconds; 0 to send again at once.
    """

    kept_reports: KeptReports
    _: KW_ONLY
    clock: Clock = field(default_factory=WallClock)
    backoff_sec: Seconds = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._untried: list[SurvivorReport] = []
        self._tried: set[str] = set()
        self._kept_at_first = 0
        self._backoff = Backoff(self.clock, self.backoff_sec, _LONGEST_BACKOFF_SEC)

    def initialise(self) -> None:
        """Begin with the oldest report."""
        self._untried = list(self.kept_reports)
        self._kept_at_first = len(self._untried)
        super().initialise()

    def request(self) -> Any:
        """Return the request for the oldest report not tried yet; SUCCESS if none is kept, RUNNING in a back-off."""
        if not self._untried:
            self.feedback_message = "no report is kept"
            return self.answer(Status.SUCCESS, "nothing kept")
        if self._backoff.left_sec > 0.0 and {report.survivor_id for report in self._untried} <= self._tried:
            self.feedback_message = f"base is tried again in {self._backoff.left_sec:.0f} s"
            return Status.RUNNING
        report = self._untried.pop(0)
        self._tried.add(report.survivor_id)
        return self._request_for(report)

    def on_response(self, response: Any) -> Status:
        """Continue with the next report: a refused one must not block the others."""
        super().on_response(response)
        if self._untried:
            return Status.RUNNING
        if self.kept_reports:
            return self._failed()
        self._backoff.reset()
        self._tried.clear()
        return self.answer(Status.SUCCESS, "delivered")

    def on_failure(self, reason: str) -> Status:
        """Return FAILURE, and begin a back-off."""
        super().on_failure(reason)
        return self._failed()

    def _failed(self) -> Status:
        self._backoff.failed()
        left = len(self.kept_reports)
        one_is_left = "all but one delivered" if left == 1 else ""
        return self.answer(Status.FAILURE, "refused" if left == self._kept_at_first else one_is_left)
