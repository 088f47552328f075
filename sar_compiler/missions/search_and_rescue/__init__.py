"""Search and rescue: the leaves of the mission and the state that they share.

This module is what the entry point `sar_compiler.nodes` names, so every leaf of the mission is in it. It
can be imported without ROS: rclpy and the message types are imported when a leaf is set up.
"""

from sar_compiler.missions.search_and_rescue.actions.navigation import NavigateToBase, NavigateToZone
from sar_compiler.missions.search_and_rescue.actions.report_queue import DeliverReports, KeepReport
from sar_compiler.missions.search_and_rescue.actions.survivors import (
    BroadcastSurvivorTF,
    DetectSurvivor,
    LogNoDetection,
    NotifyBase,
)
from sar_compiler.missions.search_and_rescue.actions.zones import AbandonZone, AdvanceZone, PostponeZone
from sar_compiler.missions.search_and_rescue.conditions import (
    IsSurvivorDetected,
    MissionComplete,
    ZonesRemaining,
)
from sar_compiler.missions.search_and_rescue.kept_reports import KeptReports
from sar_compiler.missions.search_and_rescue.record import MissionRecord
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager

__all__ = [
    "AbandonZone",
    "AdvanceZone",
    "BroadcastSurvivorTF",
    "DeliverReports",
    "DetectSurvivor",
    "IsSurvivorDetected",
    "KeepReport",
    "KeptReports",
    "LogNoDetection",
    "MissionComplete",
    "MissionRecord",
    "NavigateToBase",
    "NavigateToZone",
    "NotifyBase",
    "PostponeZone",
    "ZoneManager",
    "ZonesRemaining",
]
