"""What the mission does: drive, search, publish, report."""

from sar_compiler.mission.actions.navigation import NavigateToBase, NavigateToZone
from sar_compiler.mission.actions.survivors import (
    BroadcastSurvivorTF,
    DetectSurvivor,
    LogNoDetection,
    NotifyBase,
)
from sar_compiler.mission.actions.zones import AdvanceZone

__all__ = [
    "AdvanceZone",
    "BroadcastSurvivorTF",
    "DetectSurvivor",
    "LogNoDetection",
    "NavigateToBase",
    "NavigateToZone",
    "NotifyBase",
]
