"""What the mission does: drive, search, publish, report."""

from sar_compiler.mission.actions.keeping import DeliverReports, KeepReport
from sar_compiler.mission.actions.navigation import NavigateToBase, NavigateToZone
from sar_compiler.mission.actions.setbacks import AbandonZone, PostponeZone
from sar_compiler.mission.actions.survivors import (
    BroadcastSurvivorTF,
    DetectSurvivor,
    LogNoDetection,
    NotifyBase,
)
from sar_compiler.mission.actions.zones import AdvanceZone

__all__ = [
    "AbandonZone",
    "AdvanceZone",
    "BroadcastSurvivorTF",
    "DeliverReports",
    "DetectSurvivor",
    "KeepReport",
    "LogNoDetection",
    "NavigateToBase",
    "NavigateToZone",
    "NotifyBase",
    "PostponeZone",
]
