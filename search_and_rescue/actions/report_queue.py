"""Leaves that store undelivered reports, and send the reports when the base station responds again."""

import math
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

from py_trees.common import Status

from sar_compiler.leaves import (
    Clock,
    Kind,
    Outcome,
    RosLeaf,
    Seconds,
    Use,
    WallClock,
    register,
)
from search_and_rescue.actions.survivors import DetectSurvivor, ReportLeaf, survivor_report
from search_and_rescue.record import MissionRecord, StoredReports, SurvivorReport

_LONGEST_BACKOFF_SEC = 60.0
_KEPT = "reports_kept += kept_by_{detect_node} ? 0 : 1; kept_by_{detect_node} = true"


class Backoff:
    """The pause after a failure. Each further failure doubles the pause.

    Args:
        clock: The clock that measures the pause.
        first_sec: The pause after the first failure, seconds; 0 for none.
        longest_sec: The longest pause, seconds.
    """

    def __init__(self, clock: Clock, first_sec: float, longest_sec: float) -> None:
        self._clock = clock
        self._first_sec, self._longest_sec = first_sec, max(first_sec, longest_sec)
        self._pause_sec = 0.0
        self._since = -math.inf

    @property
    def remaining_sec(self) -> float:
        """The remaining seconds of the pause, or 0 or less if the pause is over."""
        elapsed = self._clock.now() - self._since
        # A clock that jumps back, such as that of a restarted simulator, ends the pause.
        return self._pause_sec - elapsed if elapsed >= 0.0 else 0.0

    def start_pause(self) -> None:
        """Start a pause. After each pause, the next one is twice as long."""
        self._pause_sec = min(self._pause_sec * 2 or self._first_sec, self._longest_sec)
        self._since = self._clock.now()

    def reset(self) -> None:
        """Make the next pause as short as the first one, because an attempt has succeeded."""
        self._pause_sec = 0.0


@register(
    "KeepReport",
    kind=Kind.ACTION,
    effects="stores the report of the survivor for later",
    outcomes=(
        Outcome("SUCCESS", "kept", "named_by_{detect_node}", _KEPT),
        Outcome("FAILURE", "nothing to keep", "!named_by_{detect_node}"),
    ),
    facts={"reports_kept": 0, "named_by_{detect_node}": False, "kept_by_{detect_node}": False},
)
class KeepReport(RosLeaf):
    """Store the survivor's report for `DeliverReports`. The leaf fails if no survivor was detected and named.

    Args:
        detect_node: The search that found the survivor.
        record: Records that the report is stored.
    """

    def __init__(
        self, name: str, detect_node: DetectSurvivor, *, record: MissionRecord | None = None
    ) -> None:
        super().__init__(name)
        self._detect_node = detect_node
        self._record = record or MissionRecord()

    def update(self) -> Status:
        """Store the report. Storing the same report again has no effect."""
        report = survivor_report(self._detect_node, self, self._record, "no report to store")
        if isinstance(report, Status):
            return report
        survivor_id = report.survivor_id
        self._record.report_kept(report)
        self.feedback_message = f"the report of {survivor_id} is stored"
        self.log(f"The report of {survivor_id} is stored until base acknowledges it.")
        return Status.SUCCESS


@register(
    "DeliverReports",
    kind=Kind.ACTION,
    effects="reports the survivors whose reports were stored",
    uses=(Use.service("{service}"),),
    outcomes=(
        Outcome("SUCCESS", "nothing kept", "reports_kept == 0"),
        Outcome("SUCCESS", "delivered", "reports_kept > 0", "reports_kept = 0"),
        Outcome("FAILURE", "refused", "reports_kept > 0"),
        Outcome("FAILURE", "all but one delivered", "reports_kept > 1", "reports_kept = 1"),
        Outcome("RUNNING", "reporting", "reports_kept > 0"),
    ),
    facts={"reports_kept": 0},
)
@dataclass(eq=False, repr=False)
class DeliverReports(ReportLeaf):
    """Send every stored survivor report. The leaf succeeds when no report is left.

    If a report is refused, the leaf tries all other reports, and then returns FAILURE. If the base station
    does not respond, the leaf returns FAILURE at once. After a failure, the leaf is RUNNING for a pause
    before it sends again. The first pause takes `backoff_sec`. Each further failure doubles the pause, up to
    a minute. A report that was not tried before is sent without a pause.

    Args:
        kept_reports: The stored reports.
        record: Records acknowledgements.
        clock: The clock that measures the back-off.
        timeout_sec: Time to wait for each response, in seconds.
        backoff_sec: Pause after the first failure, seconds; 0 to send again immediately.
    """

    kept_reports: StoredReports
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
        """Start with the oldest report."""
        self._untried = list(self.kept_reports)
        self._kept_at_first = len(self._untried)
        super().initialise()

    def request(self) -> Any:
        """Return the request for the oldest untried report, SUCCESS if there is no report, or RUNNING in a pause."""
        if not self._untried:
            self.feedback_message = "no report is stored"
            return self.outcome(Status.SUCCESS, "nothing kept")
        if (
            self._backoff.remaining_sec > 0.0
            and {report.survivor_id for report in self._untried} <= self._tried
        ):
            self.feedback_message = f"next attempt in {self._backoff.remaining_sec:.0f} s"
            return Status.RUNNING
        report = self._untried.pop(0)
        self._tried.add(report.survivor_id)
        return self._request_for(report)

    def on_response(self, response: Any) -> Status:
        """Continue with the next report, so that a refused report does not block the others."""
        super().on_response(response)
        if self._untried:
            return Status.RUNNING
        if self.kept_reports:
            return self._on_failure()
        self._backoff.reset()
        self._tried.clear()
        return self.outcome(Status.SUCCESS, "delivered")

    def on_failure(self, reason: str) -> Status:
        """Start a pause before the next attempt, and return FAILURE."""
        super().on_failure(reason)
        return self._on_failure()

    def _on_failure(self) -> Status:
        self._backoff.start_pause()
        left = len(self.kept_reports)
        one_is_left = "all but one delivered" if left == 1 else ""
        return self.outcome(Status.FAILURE, "refused" if left == self._kept_at_first else one_is_left)
