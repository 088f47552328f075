"""Taking over, from the facts of a journal, what earlier runs of a mission have done."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal_entries import FACTS_LOST, JournalEntry
from sar_compiler.missions.search_and_rescue.kept_reports import KeptReports, SurvivorReport
from sar_compiler.missions.search_and_rescue.orders import OperatorOrders
from sar_compiler.missions.search_and_rescue.record import MissionRecord, Standing
from sar_compiler.missions.search_and_rescue.zone_manager import Zone, ZoneManager


def recall(
    facts: Iterable[JournalEntry],
    zones: ZoneManager,
    record: MissionRecord,
    kept: KeptReports,
    orders: OperatorOrders,
) -> None:
    """Let the facts of earlier runs happen to the state of a mission that has just begun.

    Raises:
        JournalError: If the facts are not those of such a mission.
    """
    recollection = _Recollection(zones, record, kept, orders)
    for fact in facts:
        happen = recollection.kinds.get(fact.kind)
        if happen is None:
            continue
        try:
            happen(**fact.data)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            message = (
                f"fact {fact.number} of the journal, {fact.kind} {dict(fact.data)}, does not fit: {error}"
            )
            raise JournalError(message) from error


class _Recollection:
    def __init__(
        self, zones: ZoneManager, record: MissionRecord, kept: KeptReports, orders: OperatorOrders
    ) -> None:
        self._zones, self._record, self._kept, self._orders = zones, record, kept, orders
        self.kinds: Mapping[str, Callable[..., None]] = {
            "zone_added": self._zone_added,
            "zone_started": self._zone_started,
            "zone_searched": self._zone_searched,
            "survivor_unplaced": lambda zone, reason: record.survivor_unplaced(str(zone), str(reason)),
            "zone_visited": self._zone_visited,
            "zone_postponed": self._zone_postponed,
            "zone_abandoned": self._zone_abandoned,
            "survivor_named": self._survivor_named,
            "report_acknowledged": self._report_acknowledged,
            "report_kept": self._report_kept,
            "survivor_judged": self._survivor_judged,
            "base_reached": self._base_reached,
            "alarmed": record.alarmed,
            "operator_ordered": self._operator_ordered,
            FACTS_LOST: self._facts_lost,
        }

    def _facts_lost(self, numbers: Mapping[str, int], **_count: object) -> None:
        self._zones.survivor_ids_given(int(numbers.get("survivor", 0)))

    def _zone_added(self, id: str, x: float, y: float, yaw: float) -> None:  # noqa: A002 - as a zone has it
        place = _place(x, y)
        self._zones.add(Zone(id=id, x=place[0], y=place[1], yaw=_place(yaw, 0.0)[0]))

    def _zone_started(self, zone: str) -> None:
        self._record.zone_started(zone)

    def _zone_searched(self, zone: str, survivor: Any) -> None:
        place = None if survivor is None else _place(*survivor)
        self._record.zone_searched(zone, place)
        self._record.before.searched(zone, place)

    def _zone_visited(self, zone: str) -> None:
        self._leave(zone)
        self._record.zone_visited(zone)
        self._zones.advance()

    def _zone_postponed(self, zone: str) -> None:
        self._leave(zone)
        self._zones.postpone()

    def _zone_abandoned(self, zone: str, attempts: int, reason: str) -> None:
        self._leave(zone)
        if reason:
            self._record.zone_given_up(zone, reason)
        else:
            self._record.zone_abandoned(zone, int(attempts))
        self._zones.abandon(reason)

    def _leave(self, zone: str) -> None:
        current = self._zones.current_zone()["id"]
        if zone != current:
            message = f"the zone is then {current}"
            raise ValueError(message)
        self._record.before.zone_left()

    def _survivor_named(self, survivor: str, x: float, y: float, **_possibly: object) -> None:
        place = _place(x, y)
        self._record.survivor_named(survivor, *place)
        self._record.before.named(survivor, *place)
        number = survivor.rpartition("_")[2]
        if number.isdecimal():  # a leaf of somebody's own may give other names
            self._zones.survivor_ids_given(int(number))

    def _report_acknowledged(self, survivor: str) -> None:
        self._record.survivor_acknowledged(survivor)
        self._kept.delivered(survivor)

    def _report_kept(self, survivor: str) -> None:
        found = {each.survivor_id: each for each in self._record.survivors}[survivor]
        self._record.report_kept(survivor)
        self._kept.keep(SurvivorReport(survivor, found.x, found.y))

    def _survivor_judged(self, survivor: str, standing: str, same_as: str | None) -> None:
        self._record.survivor_judged(survivor, Standing(standing), same_as)
        if standing != Standing.CONFIRMED.value:
            self._kept.delivered(survivor)

    def _operator_ordered(self, order: str) -> None:
        carry_out = {
            "hold": self._orders.hold,
            "release": self._orders.release,
            "recall": self._orders.recall,
            "abort": self._orders.abort,
        }
        carry_out[order]()

    def _base_reached(self) -> None:
        self._record.base_reached()
        self._record.before.at_home(home=True)


def _place(x: Any, y: Any) -> tuple[float, float]:
    place = float(x), float(y)
    if not all(map(math.isfinite, place)):
        message = f"{place} is no position"
        raise ValueError(message)
    return place
