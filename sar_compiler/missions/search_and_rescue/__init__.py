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
from sar_compiler.missions.search_and_rescue.actions.zones import (
    AbandonZone,
    AbandonZones,
    AdvanceZone,
    PostponeZone,
)
from sar_compiler.missions.search_and_rescue.conditions import (
    IsSurvivorDetected,
    MissionComplete,
    ZonesRemaining,
)
from sar_compiler.missions.search_and_rescue.failsafes import (
    BaseInReach,
    BatterySuffices,
    InsideFence,
    MissionTimeLeft,
    NavigationAvailable,
    NotAborted,
    NotRecalled,
)
from sar_compiler.missions.search_and_rescue.kept_reports import KeptReports
from sar_compiler.missions.search_and_rescue.operating import NotHeld
from sar_compiler.missions.search_and_rescue.orders import OperatorOrders
from sar_compiler.missions.search_and_rescue.record import MissionRecord
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager

__all__ = [
    "AbandonZone",
    "AbandonZones",
    "AdvanceZone",
    "BaseInReach",
    "BatterySuffices",
    "BroadcastSurvivorTF",
    "DeliverReports",
    "DetectSurvivor",
    "InsideFence",
    "IsSurvivorDetected",
    "KeepReport",
    "KeptReports",
    "LogNoDetection",
    "MissionComplete",
    "MissionRecord",
    "MissionTimeLeft",
    "NavigateToBase",
    "NavigateToZone",
    "NavigationAvailable",
    "NotAborted",
    "NotHeld",
    "NotRecalled",
    "NotifyBase",
    "OperatorOrders",
    "PostponeZone",
    "ZoneManager",
    "ZonesRemaining",
]
