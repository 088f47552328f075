"""The summary of a mission, in a few lines."""

from collections.abc import Sequence

from sar_compiler.missions.search_and_rescue.record import MissionRecord
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager


def mission_summary(record: MissionRecord, zones: ZoneManager, elapsed_sec: float, ticks: int) -> str:
    """Return the summary of a mission."""
    shortfalls = record.shortfalls(zones)
    visited = record.zones_visited
    names = f" ({', '.join(visited)})" if visited else ""
    lines = [
        f"Summary: the mission is {'incomplete' if shortfalls else 'complete'}.",
        f"  zones visited:   {len(visited)} of {zones.total_zones()}{names}",
        *_survivor_lines(record),
        f"  back at base:    {'yes' if record.home else 'no'}",
        f"  duration:        {elapsed_sec:.1f} s, {ticks} ticks",
    ]
    return "\n".join([*lines, *_missing_lines(shortfalls)])


def _survivor_lines(record: MissionRecord) -> list[str]:
    label = "  survivors found: "
    if not record.survivors:
        return [f"{label}none"]
    told = [
        f"{survivor}, {'acknowledged' if survivor.acknowledged else 'NOT acknowledged'}"
        for survivor in record.survivors
    ]
    return [f"{label}{told[0]}", *(" " * len(label) + line for line in told[1:])]


def _missing_lines(shortfalls: Sequence[str]) -> list[str]:
    return [f"  missing:         {line}" for line in shortfalls]
