"""What the mission shows on a map."""

from collections.abc import Iterable, Iterator

from sar_compiler.missions.search_and_rescue.record import FoundSurvivor, MissionRecord
from sar_compiler.missions.search_and_rescue.zone_manager import Zone, ZoneManager
from sar_compiler.ros.landmark import Landmark

_TO_COME, _IN_HAND, _DONE, _GIVEN_UP = range(4)


def mission_landmarks(record: MissionRecord, zones: ZoneManager) -> list[Landmark]:
    """Return the zones by their states, the survivors by theirs, and the base station."""
    base, remaining = zones.base_pose(), zones.remaining_zones()
    return [
        *_zones(zones.visited_zones(), "visited", _DONE),
        *_zones(remaining[:1], "next", _IN_HAND),
        *_zones(remaining[1:], "to come", _TO_COME),
        *_zones(zones.abandoned_zones(), "abandoned", _GIVEN_UP),
        *map(_survivor, record.survivors),
        Landmark("base", "base station", base["x"], base["y"], level=_DONE if record.home else _TO_COME),
    ]


def _zones(zones: Iterable[Zone], state: str, level: int) -> Iterator[Landmark]:
    return (Landmark("zone", zone["id"], zone["x"], zone["y"], state, level) for zone in zones)


def _survivor(survivor: FoundSurvivor) -> Landmark:
    states = [survivor.standing.value, *(["report kept"] if survivor.kept else [])]
    if survivor.acknowledged:
        states.append("acknowledged")
    level = _GIVEN_UP if not survivor.counts else _DONE if survivor.acknowledged else _IN_HAND
    name = survivor.survivor_id or "survivor"
    return Landmark("survivor", name, survivor.x, survivor.y, ", ".join(states), level)
