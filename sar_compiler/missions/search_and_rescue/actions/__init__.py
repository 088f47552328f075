"""The mission's actions: drive, search, publish, report."""

from sar_compiler.missions.search_and_rescue.actions.keeping import DeliverReports, KeepReport
from sar_compiler.missions.search_and_rescue.actions.navigation import NavigateToBase, NavigateToZone
from sar_compiler.missions.search_and_rescue.actions.setbacks import AbandonZone, PostponeZone
from sar_compiler.missions.search_and_rescue.actions.survivors import (
    BroadcastSurvivorTF,
    DetectSurvivor,
    LogNoDetection,
    NotifyBase,
)
from sar_compiler.missions.search_and_rescue.actions.zones import AdvanceZone

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
