"""Search and rescue as a mission: the plug-in of the entry point `sar_compiler.missions`."""

from collections.abc import Collection
from pathlib import Path

from sar_compiler.missions import Mission, ParameterReader, shipped
from sar_compiler.missions.search_and_rescue.actions.coming_home import ReturnInReach
from sar_compiler.missions.search_and_rescue.actions.navigation import NavigateToBase
from sar_compiler.missions.search_and_rescue.conditions import ZonesRemaining
from sar_compiler.missions.search_and_rescue.hiding import HIDDEN, read_hiding
from sar_compiler.missions.search_and_rescue.homing import ENERGY, Homing, read_homing
from sar_compiler.missions.search_and_rescue.orders import OperatorOrders
from sar_compiler.missions.search_and_rescue.record import DUPLICATE_RADIUS_M, KeptReports, MissionRecord
from sar_compiler.missions.search_and_rescue.search import Search
from sar_compiler.missions.search_and_rescue.zone_manager import (
    AREA_KEYS,
    Fence,
    ZoneManager,
    read_areas,
    read_fence,
)


class SearchAndRescue(Mission):
    """Search zones for survivors, report them, come home."""

    name = "search_and_rescue"
    context_types = (ZoneManager, MissionRecord, KeptReports, OperatorOrders, Fence, Homing)
    parameter_names = (
        "zone_order",
        "zones",
        "base_station",
        "survivors",
        "geofence",
        "duplicate_radius_m",
        ENERGY,
        HIDDEN,
    )
    faults = {"detect_survivor": ("drop", "delay"), "report_survivor": ("drop", "delay", "refuse")}  # noqa: RUF012
    default_tree = "search_and_rescue"
    is_resumable = True

    def default_parameters(self) -> Path:
        """Return the shipped file."""
        return shipped("config", "mission_params.yaml")

    def default_properties(self, leaves: Collection[type]) -> Path | None:
        """Return the shipped file for a tree that visits the zones and returns home; another one if it may return early, and go on."""
        if not {ZonesRemaining, NavigateToBase} <= set(leaves):
            return None
        kind = "search_areas" if ReturnInReach in leaves else "mission"
        return shipped("config", f"{kind}_properties.yaml")

    def begin(self, reader: ParameterReader) -> "Search":
        """Begin a run with no zone visited."""
        zones, base = reader.places("zone", AREA_KEYS), reader.pose("base_station")
        radius = reader.positive("duplicate_radius_m", DUPLICATE_RADIUS_M)
        areas, speed = read_areas(reader, zones), reader.cruise_speed()
        plan = ZoneManager(zones, base, areas=areas, speed_mps=speed)
        homing, hides = read_homing(reader, plan, speed), read_hiding(reader, areas)
        return Search(plan, MissionRecord(radius), fence=read_fence(reader), homing=homing, hides=hides)


MISSION = SearchAndRescue()
