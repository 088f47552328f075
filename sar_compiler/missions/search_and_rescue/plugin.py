"""Search and rescue as a mission: the plug-in of the entry point `sar_compiler.missions`."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.missions.fence import Fence, read_fence
from sar_compiler.missions.mission import Mission, MissionRun
from sar_compiler.missions.search_and_rescue.actions.navigation import NavigateToBase
from sar_compiler.missions.search_and_rescue.conditions import ZonesRemaining
from sar_compiler.missions.search_and_rescue.kept_reports import KeptReports
from sar_compiler.missions.search_and_rescue.orders import OperatorOrders
from sar_compiler.missions.search_and_rescue.record import DUPLICATE_RADIUS_M, MissionRecord
from sar_compiler.missions.search_and_rescue.search_state import KINDS, SearchState
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager
from sar_compiler.resources import shipped
from sar_compiler.ros.parameter_reader import ParameterReader

if TYPE_CHECKING:
    from rclpy.node import Node

    from sar_compiler.journal.journal import Journal
    from sar_compiler.journal.situation import Display
    from sar_compiler.missions.verbs import Verb
    from sar_compiler.ros.faults import FaultPlan


class SearchAndRescue(Mission):
    """Search zones for survivors, report them, come home."""

    name = "search_and_rescue"
    context_types = (ZoneManager, MissionRecord, KeptReports, OperatorOrders, Fence)
    parameter_names = (
        "zone_order",
        "zones",
        "base_station",
        "survivors",
        "geofence",
        "duplicate_radius_m",
    )
    faults = {"detect_survivor": ("drop", "delay"), "report_survivor": ("drop", "delay", "refuse")}  # noqa: RUF012
    default_tree = "search_and_rescue"
    is_resumable = True

    def default_parameters(self) -> Path:
        """Return the shipped file."""
        return shipped("config", "mission_params.yaml")

    def default_properties(self, leaves: Collection[type]) -> Path | None:
        """Return the shipped file for a tree that visits the zones and returns home."""
        return (
            shipped("config", "mission_properties.yaml")
            if {ZonesRemaining, NavigateToBase} <= set(leaves)
            else None
        )

    def begin(self, reader: ParameterReader) -> "Search":
        """Begin a run with no zone visited."""
        zones, base = reader.places("zone"), reader.pose("base_station")
        radius = reader.positive("duplicate_radius_m", DUPLICATE_RADIUS_M)
        return Search(zones, base, fence=read_fence(reader), duplicate_radius_m=radius)


class Search(MissionRun):
    """One run of the mission.

    Args:
        zones: The zones in the order of their visit, each with `id`, `x`, `y` (m) and `yaw` (rad).
        base_station: The pose to return to: `x`, `y` (m) and `yaw` (rad).
        fence: The geofence.
        duplicate_radius_m: Finds that are this near to each other may be the same survivor, metres.
    """

    kinds = KINDS

    def __init__(
        self,
        zones: list[dict[str, Any]],
        base_station: dict[str, float],
        *,
        fence: Fence | None = None,
        duplicate_radius_m: float = DUPLICATE_RADIUS_M,
    ) -> None:
        self._fence = fence or Fence()
        self._state = SearchState(
            ZoneManager(zones, base_station), MissionRecord(duplicate_radius_m), fence=self._fence
        )
        self._zones, self._record = self._state.zones, self._state.record
        self._identity: dict[str, object] = {"zones": zones, "base_station": base_station}
        self.context = {
            ZoneManager: self._zones,
            MissionRecord: self._record,
            KeptReports: self._state.kept,
            OperatorOrders: self._state.orders,
            Fence: self._fence,
        }

    def greeting(self) -> list[str]:
        """Return the number of zones and the pose of the base station."""
        base = self._zones.base_pose()
        return [
            f"Loaded {self._zones.total_zones()} search zones from parameters.",
            f"Base station at ({base['x']:.2f}, {base['y']:.2f}, yaw={base['yaw']:.2f}).",
        ]

    def identity(self) -> dict[str, object]:
        """Return the zones in their order, and the base station."""
        return self._identity

    def keep_in(self, journal: "Journal") -> None:
        """Take over what earlier runs have done, and keep the facts from now on."""
        self._state.keep_in(journal)

    def apply(self, fact: JournalEntry) -> None:
        """Change the state by a fact."""
        self._state.apply(fact)

    def sentence(self, fact: JournalEntry) -> str:
        """Return a fact as a sentence."""
        return self._state.sentence(fact)

    def facts(self) -> dict[str, int]:
        """Return the number of zones."""
        return {"zones_left": self._zones.total_zones()}

    def verbs(self) -> "Sequence[Verb]":
        """Return the orders that guarded trees heed."""
        from sar_compiler.missions.search_and_rescue.operator_verbs import VERBS

        return VERBS

    def places(self) -> dict[str, tuple[float, float]]:
        """Return the positions of the zones."""
        return {zone["id"]: (zone["x"], zone["y"]) for zone in self._zones.remaining_zones()}

    def route(self) -> list[tuple[str, float, float]]:
        """Return the zones that are left, and the base station."""
        base = self._zones.base_pose()
        zones = [(zone["id"], zone["x"], zone["y"]) for zone in self._zones.remaining_zones()]
        return [*zones, ("base station", base["x"], base["y"])]

    def display(self) -> "Display":
        """Return the zones, the survivors, the base station and the geofence, with their states, and how far it is."""
        return self._state.display()

    def allows(self, x: float, y: float) -> bool:
        """Return whether a position is inside the geofence."""
        return self._fence.contains(x, y)

    def servers(self, faults: "FaultPlan", **options: Any) -> "list[Node]":
        """Create the two servers."""
        from sar_compiler.missions.search_and_rescue.detect_survivor_server import DetectSurvivorServer
        from sar_compiler.missions.search_and_rescue.report_survivor_server import ReportSurvivorServer

        return [
            DetectSurvivorServer(faults=faults.for_service("detect_survivor"), **options),
            ReportSurvivorServer(faults=faults.for_service("report_survivor"), **options),
        ]

    def shortfalls(self) -> list[str]:
        """Return what is not yet visited, acknowledged, or home."""
        return self._record.shortfalls(self._zones)

    def nothing_left(self) -> str:
        """Return that no zone is left, once that is so."""
        return "" if self._zones.has_remaining() else "No zone is left"

    def summary(self, elapsed_sec: float, ticks: int) -> str:
        """Return the zones, the survivors, the return home, and what is missing."""
        record, visited = self._record, self._record.zones_visited
        shortfalls = self.shortfalls()
        names = f" ({', '.join(visited)})" if visited else ""
        return "\n".join(
            (
                f"Summary: the mission is {'incomplete' if shortfalls else 'complete'}.",
                f"  zones visited:   {len(visited)} of {self._zones.total_zones()}{names}",
                *_survivor_lines(record),
                f"  back at base:    {'yes' if record.home else 'no'}",
                f"  duration:        {elapsed_sec:.1f} s, {ticks} ticks",
                *(f"  missing:         {line}" for line in shortfalls),
            )
        )


def _survivor_lines(record: MissionRecord) -> list[str]:
    label = "  survivors found: "
    if not record.survivors:
        return [f"{label}none"]
    told = [
        f"{survivor}, {'acknowledged' if survivor.acknowledged else 'NOT acknowledged'}"
        for survivor in record.survivors
    ]
    return [f"{label}{told[0]}", *(" " * len(label) + line for line in told[1:])]


MISSION = SearchAndRescue()
