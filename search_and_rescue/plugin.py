"""The mission plug-in for search and rescue, registered as an entry point of the group `sar_compiler.missions`."""

from collections.abc import Collection
from pathlib import Path

from sar_compiler.missions import Mission, ParameterReader, shared_file_path
from search_and_rescue.actions.navigation import NavigateToBase
from search_and_rescue.actions.return_checks import ReturnInReach
from search_and_rescue.actions.sweep_leaves import PlanSweep
from search_and_rescue.areas import (
    AREA_KEYS,
    add_plausibility_notes,
    read_areas,
    read_grounds,
    read_priorities,
)
from search_and_rescue.areas_file import AREAS_FILE, read_areas_file
from search_and_rescue.conditions import ZonesRemaining
from search_and_rescue.hiding import HIDDEN, read_hidden_survivor
from search_and_rescue.homing_estimates import (
    CHARGING,
    ENERGY,
    HomingEstimator,
    read_charging,
    read_homing,
)
from search_and_rescue.operator_commands import OperatorCommands
from search_and_rescue.record import DUPLICATE_RADIUS_M, MissionRecord, StoredReports
from search_and_rescue.search import Search
from search_and_rescue.sweep_record import SweepStates
from search_and_rescue.zone_manager import Geofence, ZoneManager, read_fence


class SearchAndRescue(Mission):
    """The search and rescue mission: search zones for survivors, report the survivors, and return home."""

    name = "search_and_rescue"
    context_types = (
        ZoneManager,
        MissionRecord,
        StoredReports,
        OperatorCommands,
        Geofence,
        HomingEstimator,
        SweepStates,
    )
    parameter_names = (
        "zone_order",
        "zones",
        "base_station",
        "survivors",
        "geofence",
        "duplicate_radius_m",
        "wanted_success",
        ENERGY,
        CHARGING,
        HIDDEN,
        AREAS_FILE,
    )
    path_parameters = (AREAS_FILE,)
    faults = {"detect_survivor": ("drop", "delay"), "report_survivor": ("drop", "delay", "refuse")}  # noqa: RUF012
    default_tree = "search_and_rescue"
    is_resumable = True

    def default_parameters(self) -> Path:
        """Return the path of the parameter file in the package."""
        return shared_file_path("config", "mission_params.yaml")

    def default_properties(self, leaves: Collection[type]) -> Path | None:
        """Return the property file for a tree with these leaves, or None if no file fits the tree."""
        if not {ZonesRemaining, NavigateToBase} <= set(leaves):
            return None
        early = "search_areas" if ReturnInReach in leaves else "mission"
        return shared_file_path(
            "config", f"{'search_sweeps' if PlanSweep in leaves else early}_properties.yaml"
        )

    def begin(self, reader: ParameterReader) -> "Search":
        """Read the parameters, and return the run with which a mission starts."""
        read_areas_file(reader)
        zones, base = reader.places("zone", AREA_KEYS), reader.pose("base_station")
        radius = reader.positive("duplicate_radius_m", DUPLICATE_RADIUS_M)
        speed, fence = reader.cruise_speed(), read_fence(reader)
        grounds = read_grounds(reader, zones, fence)
        sweeps_sec: dict[str, float] = {}
        # Avoid a division by a speed or sweep width of 0, which has already been reported as an error.
        if not reader.problems:
            sweeps_sec = {zone: each.sweep_sec(speed) for zone, each in grounds.items()}
            add_plausibility_notes(reader, zones, grounds)
        areas, priorities = read_areas(reader, zones, sweeps_sec), read_priorities(reader, zones)
        plan = ZoneManager(
            zones,
            base,
            areas=areas,
            priorities=priorities,
            speed_mps=speed,
            charging=read_charging(reader, fence),
        )
        sweeps = SweepStates(grounds)
        homing = read_homing(reader, plan, sweeps, speed)
        return Search(
            plan,
            MissionRecord(radius),
            fence=fence,
            homing=homing,
            sweeps=sweeps,
            hides=read_hidden_survivor(reader, areas),
            wanted_success=reader.positive("wanted_success", 0.0, 1.0),
        )


MISSION = SearchAndRescue()
