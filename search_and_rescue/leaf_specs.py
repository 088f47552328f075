"""What the leaves of the mission are, each named by the import path of its class.

So a tree of the mission is checked without an import of what flies it.
"""

from functools import partial
from typing import Literal

from sar_compiler.leaves import (
    Answer,
    Clock,
    Kind,
    Seconds,
    Use,
    at_least,
    attribute,
    handed_over,
    leaf_spec,
    reference,
    sensible,
)

VisitingOrder = Literal["listed", "nearest", "expected_find"]
"""How the next zone is chosen."""

SweepPattern = Literal["parallel", "creeping_line", "expanding_square", "sector"]
"""How a sweep goes: legs along the long side, along the short side, a square growing around the zone's pose, or diameters through it."""

_condition = partial(leaf_spec, kind=Kind.CONDITION)
_HERE = "search_and_rescue"
_ZONES = f"{_HERE}.zone_manager:ZoneManager"
_RECORD = f"{_HERE}.record:MissionRecord"
_KEPT_REPORTS = f"{_HERE}.record:KeptReports"
_ORDERS = f"{_HERE}.orders:OperatorOrders"
_SEARCH = f"{_HERE}.actions.survivors:DetectSurvivor"
_FENCE = f"{_HERE}.zone_manager:Fence"
_HOMING = f"{_HERE}.homing:Homing"
_SWEEPS = f"{_HERE}.sweep_record:Sweeps"

_NAMED = "named_by_{detect_node} = true; kept_by_{detect_node} = false"
_ACKNOWLEDGED = (
    "reports_kept -= kept_by_{detect_node} && reports_kept > 0 ? 1 : 0; kept_by_{detect_node} = false"
)
_SKIPPED = "orders_left -= 1; zones_left -= 1; zones_abandoned += 1"
_BASE_LOST = "losses_left -= base_lost ? 0 : 1; base_lost = true"
_FORGOTTEN = "found_by_{self} = false; named_by_{self} = false"
_UNTOLD = "found_by_{detect_node} = false; named_by_{detect_node} = false"
_KEPT = "reports_kept += kept_by_{detect_node} ? 0 : 1; kept_by_{detect_node} = true"
# Zones are postponed in rounds: a postponed zone is next when all others have been tried. So the number of
# attempts at the current zone is the number of the round; a round is over when all remaining zones have been
# postponed in it.
_ROUND_IS_OVER = "postponed_in_round >= zones_left"
_NEXT_ROUND = f"({_ROUND_IS_OVER} ? round + 1 : round)"
_POSTPONED = (
    f"round += {_ROUND_IS_OVER} ? 1 : 0; postponed_in_round = {_ROUND_IS_OVER} ? 1 : postponed_in_round + 1"
)
_AT_CHARGE = "(at == 'base' || at == 'charging')"
_COMPLETE = "zones_left == 0 && zones_abandoned == 0 && reports_kept == 0 && at == 'base'"
_SERVER_TIMEOUT = attribute("server_timeout_sec", Seconds, "How long to wait for a server, seconds.", 10.0)
_DRIVING = (
    _SERVER_TIMEOUT,
    attribute(
        "acceptance_timeout_sec", Seconds, "How long to wait for the goal to be accepted, seconds.", 5.0
    ),
    attribute("feedback_timeout_sec", Seconds, "How long a server may be silent, seconds.", 10.0),
    attribute(
        "hold_timeout_sec",
        Seconds,
        "How long to wait for somebody to judge the goal: for Nav2 and its localisation, or the end of another client's goal, seconds.",
        60.0,
    ),
)
_DRIVE = (attribute("action", str, "The action's name.", "navigate_to_pose"), *_DRIVING)


_ON_GROUND = (
    handed_over("zone_manager", _ZONES, "The mission's zones."),
    handed_over("sweeps", _SWEEPS, "The mission's sweeps."),
)
# Whoever writes per cent is warned.
_SHARE = sensible(0, 1)
_UNTIL_POD = attribute(
    "until_pod",
    _SHARE,
    "Ground where somebody would have been found with less than that, 0 to 1, is a gap.",
    0.8,
)
_CLEARANCE = attribute("clearance", sensible(0), "How far pieces keep from obstacles, metres.", 0.3)
# How many pieces there are nobody knows before the flight: what a leaf answers says whether one is open. In proofs a run has so many more than
# one a pass.
_PIECES = {"zones_left": 3, "piece_open": False, "more_pieces": 1}
# Where no zone is left, no piece is open, whatever was planned.
_OPEN = "zones_left > 0 && piece_open"
_PLANNER = (
    attribute(
        "ways_timeout_sec",
        Seconds,
        "How long the planner may take for all ways together, seconds of the machine; not waited for where it is not there.",
        5.0,
    ),
    attribute(
        "planner_id", str, "Which of the planner server's planners is asked; empty for its only one.", ""
    ),
)

SPECS = [
    leaf_spec(
        f"{_HERE}.actions.navigation:NavigateToZone",
        "Drive to the current zone: RUNNING on the way, SUCCESS on arrival, FAILURE if Nav2 does not get there.",
        handed_over("zone_manager", _ZONES, "The mission's zones."),
        handed_over("record", _RECORD, "Where the drive is noted.", required=False),
        *_DRIVE,
        effects="drives the robot to the current zone",
        uses=(Use.action("{action}"), Use.nav2()),
        answers=(
            Answer("SUCCESS", "arrived", "zones_left > 0", "at = 'zone'; navigation_lost = false"),
            Answer("FAILURE", "aborted", "zones_left > 0", "navigation_lost = false"),
            Answer("FAILURE", "no zone", "zones_left == 0"),
            Answer("FAILURE", "unavailable", "zones_left > 0", "navigation_lost = true"),
            Answer("RUNNING", "driving", "zones_left > 0", "at = ''; navigation_lost = false"),
            Answer("RUNNING", "waiting for Nav2", "zones_left > 0", "at = ''; navigation_lost = true"),
            Answer("RUNNING", "not arrived", "zones_left > 0", "at = ''; navigation_lost = true"),
        ),
        facts={"zones_left": 3, "at": "", "navigation_lost": False},
    ),
    leaf_spec(
        f"{_HERE}.actions.navigation:NavigateToBase",
        "Drive to the base station: RUNNING on the way, SUCCESS on arrival, FAILURE if Nav2 does not get there.",
        handed_over("zone_manager", _ZONES, "The mission's zones and base station."),
        handed_over("record", _RECORD, "Where the return is noted.", required=False),
        *_DRIVE,
        effects="drives the robot to the base station",
        uses=(Use.action("{action}"), Use.nav2()),
        answers=(
            Answer("SUCCESS", "arrived", then="at = 'base'; navigation_lost = false"),
            Answer("FAILURE", "aborted", then="navigation_lost = false"),
            Answer("FAILURE", "unavailable", then="navigation_lost = true"),
            Answer("RUNNING", "driving", then="at = ''; navigation_lost = false"),
            Answer("RUNNING", "waiting for Nav2", then="at = ''; navigation_lost = true"),
            Answer("RUNNING", "not arrived", then="at = ''; navigation_lost = true"),
        ),
        facts={"at": "", "navigation_lost": False},
    ),
    leaf_spec(
        f"{_HERE}.actions.survivors:DetectSurvivor",
        "Search the current zone, and keep the answer: SUCCESS whether or not a survivor was found.",
        handed_over("zone_manager", _ZONES, "The mission's zones."),
        handed_over("record", _RECORD, "Where a find is noted.", required=False),
        attribute("service", str, "The service's name.", "detect_survivor"),
        _SERVER_TIMEOUT,
        attribute("timeout_sec", Seconds, "How long to wait for the answer, seconds.", 5.0),
        effects="searches the current zone for a survivor",
        uses=(Use.service("{service}"),),
        answers=(
            Answer("SUCCESS", "found", "zones_left > 0", "found_by_{self} = true; named_by_{self} = false"),
            Answer("SUCCESS", "nothing", "zones_left > 0", _FORGOTTEN),
            Answer("FAILURE", "no answer", "zones_left > 0", _FORGOTTEN),
            Answer("FAILURE", "no zone", "zones_left == 0", _FORGOTTEN),
            Answer("RUNNING", "searching", "zones_left > 0", _FORGOTTEN),
        ),
        facts={"zones_left": 3, "found_by_{self}": False, "named_by_{self}": False},
        reads=("at",),
    ),
    leaf_spec(
        f"{_HERE}.actions.survivors:AwaitSurvivor",
        "Wait until a detector publishes somebody who has no name yet, and tell the search: SUCCESS then, RUNNING before.",
        reference("detect_node", _SEARCH, "The search that is told where the survivor is."),
        handed_over("zone_manager", _ZONES, "The mission's zones: the find counts for the current one."),
        handed_over("record", _RECORD, "Where the find is noted, and who was found before.", required=False),
        attribute(
            "topic",
            str,
            "The topic's name (`geometry_msgs/msg/PointStamped`, frame `map`, metres).",
            "survivor_detections",
        ),
        attribute("same_within", float, "How near two finds are the same survivor, metres.", 1.0),
        effects="takes what a detector has seen",
        uses=(Use.topic("{topic}"),),
        answers=(
            Answer(
                "SUCCESS",
                "found",
                "zones_left > 0",
                "found_by_{detect_node} = true; named_by_{detect_node} = false",
            ),
            Answer("FAILURE", "no zone", "zones_left == 0", _UNTOLD),
            Answer("RUNNING", "listening", "zones_left > 0", _UNTOLD),
        ),
        facts={"zones_left": 3, "found_by_{detect_node}": False, "named_by_{detect_node}": False},
    ),
    leaf_spec(
        f"{_HERE}.actions.survivors:BroadcastSurvivorTF",
        "Give the survivor that was found a name, and publish a static frame of that name under `map`.",
        reference("detect_node", _SEARCH, "The search that found the survivor; is told the name."),
        handed_over("zone_manager", _ZONES, "Gives out the names."),
        handed_over("record", _RECORD, "Where the name is noted.", required=False),
        effects="gives the survivor a new name, with a static frame there",
        answers=(
            Answer("SUCCESS", "named", "found_by_{detect_node}", _NAMED),
            Answer("FAILURE", "nobody found", "!found_by_{detect_node}"),
        ),
        facts=dict.fromkeys(
            ["found_by_{detect_node}", "named_by_{detect_node}", "kept_by_{detect_node}"], False
        ),
    ),
    leaf_spec(
        f"{_HERE}.actions.survivors:NotifyBase",
        "Report the survivor that was found: SUCCESS if the base station acknowledges the report.",
        reference("detect_node", _SEARCH, "The search that found the survivor."),
        handed_over("record", _RECORD, "Where the acknowledgement is noted.", required=False),
        attribute("service", str, "The service's name.", "report_survivor"),
        _SERVER_TIMEOUT,
        attribute("timeout_sec", Seconds, "How long to wait for the answer, seconds.", 5.0),
        effects="reports the survivor to the base station",
        uses=(Use.service("{service}"),),
        answers=(
            Answer("SUCCESS", "acknowledged", "named_by_{detect_node}", _ACKNOWLEDGED),
            Answer("FAILURE", "refused", "named_by_{detect_node}"),
            Answer("FAILURE", "nothing to report", "!named_by_{detect_node}"),
            Answer("RUNNING", "reporting", "named_by_{detect_node}"),
        ),
        facts={"named_by_{detect_node}": False, "kept_by_{detect_node}": False, "reports_kept": 0},
    ),
    leaf_spec(
        f"{_HERE}.actions.survivors:LogNoDetection",
        "Log that no survivor was found.",
        handed_over("zone_manager", _ZONES, "Names the zone, if requested.", required=False),
        handed_over("record", _RECORD, "Knows who was found there all the same.", required=False),
        answers=(Answer("SUCCESS", "logged"),),
    ),
    leaf_spec(
        f"{_HERE}.actions.report_queue:KeepReport",
        "Keep the report of the survivor that was found, for `DeliverReports`; FAILURE if there is none with a name.",
        reference("detect_node", _SEARCH, "The search that found the survivor."),
        handed_over("record", _RECORD, "Where it is noted that the report is kept.", required=False),
        effects="keeps the report of the survivor for later",
        answers=(
            Answer("SUCCESS", "kept", "named_by_{detect_node}", _KEPT),
            Answer("FAILURE", "nothing to keep", "!named_by_{detect_node}"),
        ),
        facts={"reports_kept": 0, "named_by_{detect_node}": False, "kept_by_{detect_node}": False},
    ),
    leaf_spec(
        f"{_HERE}.actions.report_queue:DeliverReports",
        "Report each survivor whose report was kept: SUCCESS if none is left, at once if there was none.",
        handed_over("kept_reports", _KEPT_REPORTS, "Where the reports are kept."),
        handed_over("record", _RECORD, "Where acknowledgements are noted.", required=False),
        attribute("service", str, "The service's name.", "report_survivor"),
        _SERVER_TIMEOUT,
        attribute("timeout_sec", Seconds, "How long to wait for each answer, seconds.", 5.0),
        handed_over("clock", Clock, "The clock of the back-off.", required=False),
        attribute(
            "backoff_sec",
            Seconds,
            "How long to send nothing after the first failure, seconds; 0 to send again at once.",
            0.0,
        ),
        effects="reports the survivors whose reports were kept",
        uses=(Use.service("{service}"),),
        answers=(
            Answer("SUCCESS", "nothing kept", "reports_kept == 0"),
            Answer("SUCCESS", "delivered", "reports_kept > 0", "reports_kept = 0"),
            Answer("FAILURE", "refused", "reports_kept > 0"),
            Answer("FAILURE", "all but one delivered", "reports_kept > 1", "reports_kept = 1"),
            Answer("RUNNING", "reporting", "reports_kept > 0"),
        ),
        facts={"reports_kept": 0},
    ),
    leaf_spec(
        f"{_HERE}.actions.zones:AdvanceZone",
        "Mark the current zone as visited, so that the next one becomes the current zone.",
        handed_over("zone_manager", _ZONES, "The mission's zones."),
        effects="marks the current zone as visited",
        answers=(
            Answer("SUCCESS", "advanced", "zones_left > 0", "zones_left -= 1"),
            Answer("SUCCESS", "no zone", "zones_left == 0"),
        ),
        facts={"zones_left": 3},
        writes=("at",),
    ),
    leaf_spec(
        f"{_HERE}.actions.zones:ChooseZone",
        "Choose which of the zones that are left is the current one: RUNNING while that is computed, beside the ticks.",
        handed_over("zone_manager", _ZONES, "The mission's zones, and where somebody may be."),
        attribute(
            "order",
            VisitingOrder,
            "How: `listed` keeps the order of the plan, `nearest` takes what is reached first, `expected_find` finds soonest.",
            "listed",
        ),
        *_PLANNER,
        handed_over(
            "orders",
            _ORDERS,
            "Takes the operator's hints on where somebody may be, by the service `~/add_hint` (`sar_interfaces/srv/AddHint`).",
            required=False,
        ),
        handed_over(
            "sweeps",
            _SWEEPS,
            "The mission's sweeps: a hint on a place counts for the zone whose outline is around it.",
            required=False,
        ),
        effects="makes one of the zones that are left the current one",
        answers=(
            Answer("SUCCESS", "chosen", "zones_left > 0"),
            Answer("FAILURE", "no zone", "zones_left == 0"),
            Answer("RUNNING", "choosing", "zones_left > 0"),
        ),
        facts={"zones_left": 3},
    ),
    leaf_spec(
        f"{_HERE}.actions.coming_home:ReturnInReach",
        "Is enough left for the next leg and the way home? SUCCESS if so; FAILURE if the robot is to come home first.",
        handed_over("homing", _HOMING, "What it takes to come home."),
        handed_over("clock", Clock, "The mission's clock."),
        handed_over("record", _RECORD, "Where it is noted that the robot comes home first.", required=False),
        attribute(
            "limit",
            Seconds,
            "How long the mission may take, seconds of the mission's clock from the first tick on; 0 for no limit.",
            0.0,
        ),
        attribute(
            "max_age_sec", Seconds, "How long the battery may be silent, seconds of the node's clock.", 30.0
        ),
        uses=(Use.topic("battery_state"),),
        answers=(
            Answer("SUCCESS", "in reach", "zones_left > 0"),
            Answer("FAILURE", "out of reach", "zones_left > 0"),
            Answer("FAILURE", "no zone", "zones_left == 0"),
            Answer("RUNNING", "battery unknown", "zones_left > 0"),
        ),
        facts={"zones_left": 3},
    ),
    leaf_spec(
        f"{_HERE}.actions.coming_home:FullBatterySuffices",
        "Would a full battery suffice for the next leg, from home and back? SUCCESS if so, else FAILURE: no charge helps.",
        handed_over("homing", _HOMING, "What it takes to come home."),
        *_PLANNER,
        answers=(
            Answer("SUCCESS", "suffices", "zones_left > 0"),
            Answer("FAILURE", "too far", "zones_left > 0"),
            Answer("FAILURE", "no zone", "zones_left == 0"),
            Answer("RUNNING", "asking for ways", "zones_left > 0"),
        ),
        facts={"zones_left": 3},
    ),
    leaf_spec(
        f"{_HERE}.actions.coming_home:NavigateToCharge",
        "Drive to where the battery is charged: home, or a charging place that is nearer and reached with the reserve.",
        handed_over("zone_manager", _ZONES, "The mission's zones and base station."),
        handed_over("record", _RECORD, "Where the return is noted.", required=False),
        *_DRIVE,
        handed_over("homing", _HOMING, "What it takes to come home."),
        effects="drives the robot to the base station or a charging place",
        uses=(Use.action("{action}"), Use.nav2()),
        answers=(
            Answer("SUCCESS", "arrived", then="at = 'charging'; navigation_lost = false"),
            Answer("FAILURE", "aborted", then="navigation_lost = false"),
            Answer("FAILURE", "unavailable", then="navigation_lost = true"),
            Answer("RUNNING", "driving", then="at = ''; navigation_lost = false"),
            Answer("RUNNING", "waiting for Nav2", then="at = ''; navigation_lost = true"),
            Answer("RUNNING", "not arrived", then="at = ''; navigation_lost = true"),
        ),
        facts={"at": "", "navigation_lost": False},
    ),
    leaf_spec(
        f"{_HERE}.actions.coming_home:AwaitCharge",
        "Wait at home, or at a charging place, until the battery was charged or swapped and suffices for the next leg.",
        handed_over("homing", _HOMING, "What it takes to come home."),
        handed_over("clock", Clock, "The clock of the patience."),
        handed_over(
            "record",
            _RECORD,
            "Knows whether the robot is there; where it is noted what has come of it.",
            required=False,
        ),
        attribute("patience", Seconds, "How long to wait, seconds of the mission's clock.", 900.0),
        uses=(Use.topic("battery_state"),),
        answers=(
            Answer("SUCCESS", "charged", f"zones_left > 0 && {_AT_CHARGE}"),
            Answer("FAILURE", "not charged"),
            Answer("RUNNING", "waiting", f"zones_left > 0 && {_AT_CHARGE}"),
        ),
        facts={"zones_left": 3, "at": ""},
    ),
    leaf_spec(
        f"{_HERE}.actions.sweeping:PlanSweep",
        "Plan the sweep of the current zone's ground; one that is planned goes on where it is.",
        *_ON_GROUND,
        attribute(
            "pattern",
            SweepPattern,
            "How: `parallel` legs along the long side, a `creeping_line` along the short side, an `expanding_square` around the zone's "
            "pose, or the diameters of a `sector` search through it.",
            "parallel",
        ),
        attribute(
            "coverage",
            sensible(0, is_open=True),
            "How often each place is covered by the sweep width: legs are sweep width / coverage apart.",
            0.9,
        ),
        handed_over(
            "orders",
            _ORDERS,
            "Takes the operator's areas, by the service `~/add_area` (`sar_interfaces/srv/AddArea`).",
            required=False,
        ),
        handed_over("fence", _FENCE, "The geofence, for areas that are drawn.", required=False),
        _CLEARANCE,
        effects="plans the pieces of a sweep",
        answers=(
            Answer("SUCCESS", "planned", "zones_left > 0", "piece_open = true"),
            Answer("SUCCESS", "going on", "zones_left > 0", "piece_open = true"),
            Answer("SUCCESS", "swept before", "zones_left > 0", "piece_open = false"),
            Answer("FAILURE", "nothing to sweep", "zones_left > 0"),
            Answer("FAILURE", "no zone", "zones_left == 0"),
            Answer("RUNNING", "planning", "zones_left > 0"),
        ),
        facts=_PIECES,
    ),
    leaf_spec(
        f"{_HERE}.actions.sweeping:RefineSweep",
        "Plan to look once more at what the sweep of the current zone has missed: SUCCESS if there is such ground.",
        *_ON_GROUND,
        attribute("until_pod", _SHARE, "How likely somebody there must have been found, 0 to 1.", 0.8),
        attribute("max_passes", at_least(1), "How many passes there are at most, the first one included.", 3),
        _CLEARANCE,
        effects="plans the pieces of a further pass",
        answers=(
            Answer("SUCCESS", "planned", "zones_left > 0 && !piece_open", "piece_open = true"),
            Answer("SUCCESS", "going on", _OPEN),
            Answer("FAILURE", "nothing to sweep", "zones_left > 0 && !piece_open"),
            Answer("FAILURE", "no zone", "zones_left == 0"),
            Answer("RUNNING", "planning", "zones_left > 0 && !piece_open"),
        ),
        facts=_PIECES,
    ),
    leaf_spec(
        f"{_HERE}.actions.sweeping:NavigateToPiece",
        "Drive to the current piece of the sweep, and keep what is seen on the way.",
        handed_over("zone_manager", _ZONES, "The mission's zones."),
        handed_over("record", _RECORD, "Where the drive is noted.", required=False),
        *_DRIVE,
        handed_over("sweeps", _SWEEPS, "The mission's sweeps."),
        effects="drives the robot to the current piece",
        uses=(Use.action("{action}"), Use.nav2()),
        answers=(
            Answer("SUCCESS", "arrived", _OPEN, "at = 'zone'; navigation_lost = false"),
            Answer("FAILURE", "aborted", _OPEN, "navigation_lost = false"),
            Answer("FAILURE", "no piece", f"!({_OPEN})"),
            Answer("FAILURE", "unavailable", _OPEN, "navigation_lost = true"),
            Answer("RUNNING", "driving", _OPEN, "at = ''; navigation_lost = false"),
            Answer("RUNNING", "waiting for Nav2", _OPEN, "at = ''; navigation_lost = true"),
            Answer("RUNNING", "not arrived", _OPEN, "at = ''; navigation_lost = true"),
        ),
        facts={**_PIECES, "at": "", "navigation_lost": False},
    ),
    leaf_spec(
        f"{_HERE}.actions.sweeping:NavigateThroughPieces",
        "Drive through all open pieces of the sweep without a stop, and mark each as swept when it is passed.",
        handed_over("zone_manager", _ZONES, "The mission's zones."),
        handed_over("record", _RECORD, "Where the drive is noted.", required=False),
        attribute("action", str, "The action's name.", "navigate_through_poses"),
        *_DRIVING,
        handed_over("sweeps", _SWEEPS, "The mission's sweeps."),
        handed_over("homing", _HOMING, "What it takes to come home; counts where the tree asks for it."),
        handed_over("clock", Clock, "The mission's clock."),
        _UNTIL_POD,
        effects="drives the robot through the pieces, and marks them as swept",
        # Not the action: where nobody serves it, nobody is to wait for it.
        uses=(Use.nav2(),),
        answers=(
            Answer("SUCCESS", "all done", _OPEN, "piece_open = false; at = 'zone'; navigation_lost = false"),
            Answer("FAILURE", "aborted", _OPEN, "navigation_lost = false"),
            Answer("FAILURE", "no piece", f"!({_OPEN})"),
            Answer("FAILURE", "piece by piece", _OPEN),
            Answer("FAILURE", "unavailable", _OPEN, "navigation_lost = true"),
            Answer("RUNNING", "driving", _OPEN, "at = ''; navigation_lost = false"),
            Answer("RUNNING", "waiting for Nav2", _OPEN, "at = ''; navigation_lost = true"),
            Answer("RUNNING", "not arrived", _OPEN, "at = ''; navigation_lost = true"),
        ),
        facts={**_PIECES, "at": "", "navigation_lost": False},
    ),
    leaf_spec(
        f"{_HERE}.actions.sweeping:AdvancePiece",
        "Mark the current piece as swept, with what was seen so far; the next one becomes the current piece.",
        *_ON_GROUND,
        _UNTIL_POD,
        effects="marks the current piece as swept",
        answers=(
            Answer("SUCCESS", "advanced", f"{_OPEN} && more_pieces > 0", "more_pieces -= 1"),
            Answer("SUCCESS", "all done", _OPEN, "piece_open = false"),
            Answer("SUCCESS", "no piece", f"!({_OPEN})"),
        ),
        facts=_PIECES,
    ),
    leaf_spec(
        f"{_HERE}.actions.sweeping:SkipPiece",
        "Leave the current piece out, as one that cannot be reached or searched; the next one becomes the current piece.",
        *_ON_GROUND,
        effects="leaves the current piece out",
        answers=(
            Answer("SUCCESS", "skipped", f"{_OPEN} && more_pieces > 0", "more_pieces -= 1"),
            Answer("SUCCESS", "skipped the last", _OPEN, "piece_open = false"),
            Answer("SUCCESS", "no piece", f"!({_OPEN})"),
        ),
        facts=_PIECES,
    ),
    leaf_spec(
        f"{_HERE}.actions.zones:PostponeZone",
        "Put the current zone after all others, to try it again later; FAILURE after its last attempt.",
        handed_over("zone_manager", _ZONES, "The mission's zones."),
        attribute(
            "attempts",
            at_least(1),
            "The number of attempts at a zone, 1 or more; after the last one it is not postponed again.",
            3,
        ),
        effects="puts the current zone behind all others",
        answers=(
            Answer("SUCCESS", "postponed", f"zones_left > 0 && {_NEXT_ROUND} < {{attempts}}", _POSTPONED),
            Answer("FAILURE", "tried often enough", f"zones_left == 0 || {_NEXT_ROUND} >= {{attempts}}"),
        ),
        facts={"zones_left": 3, "round": 1, "postponed_in_round": 0},
    ),
    leaf_spec(
        f"{_HERE}.actions.zones:AbandonZone",
        "Take the current zone out of the plan, unvisited; the mission can then no longer be complete.",
        handed_over("zone_manager", _ZONES, "The mission's zones."),
        effects="takes the current zone out of the plan, unvisited",
        answers=(
            Answer("SUCCESS", "abandoned", "zones_left > 0", "zones_left -= 1; zones_abandoned += 1"),
            Answer("SUCCESS", "no zone", "zones_left == 0"),
        ),
        facts={"zones_left": 3, "zones_abandoned": 0},
    ),
    leaf_spec(
        f"{_HERE}.actions.zones:AbandonZones",
        "Take all zones that are left out of the plan, unvisited, for the reason that a failsafe has given.",
        handed_over("zone_manager", _ZONES, "The mission's zones."),
        handed_over("record", _RECORD, "Knows the reason.", required=False),
        effects="takes all zones that are left out of the plan, unvisited",
        answers=(Answer("SUCCESS", "abandoned", then="zones_abandoned += zones_left; zones_left = 0"),),
        facts={"zones_left": 3, "zones_abandoned": 0},
    ),
    _condition(
        f"{_HERE}.conditions:ZonesRemaining",
        "Is a zone left to be visited? SUCCESS if so, else FAILURE.",
        handed_over("zone_manager", _ZONES, "The mission's zones."),
        answers=(
            Answer("SUCCESS", "some left", "zones_left > 0"),
            Answer("FAILURE", "none left", "zones_left == 0"),
        ),
        facts={"zones_left": 3},
    ),
    _condition(
        f"{_HERE}.actions.sweeping:ZoneHasGround",
        "Has the current zone an outline, so that it can be swept? SUCCESS if so, else FAILURE.",
        *_ON_GROUND,
        answers=(Answer("SUCCESS", "yes", "zones_left > 0"), Answer("FAILURE", "no")),
        facts={"zones_left": 3},
    ),
    _condition(
        f"{_HERE}.actions.sweeping:PiecesRemaining",
        "Is a piece of the current zone's sweep open? SUCCESS if so, else FAILURE.",
        *_ON_GROUND,
        answers=(
            Answer("SUCCESS", "some left", _OPEN),
            Answer("FAILURE", "none left", f"!({_OPEN})"),
        ),
        facts=_PIECES,
    ),
    _condition(
        f"{_HERE}.actions.sweeping:IsFindNew",
        "Is the survivor that the last search has found somebody who has no name yet? SUCCESS if so, else FAILURE.",
        reference("detect_node", _SEARCH, "The search whose answer counts."),
        handed_over("record", _RECORD, "Who was found before."),
        attribute("same_within", float, "How near two finds are the same survivor, metres.", 1.0),
        answers=(
            Answer("SUCCESS", "new", "found_by_{detect_node}"),
            Answer("FAILURE", "known", "found_by_{detect_node}"),
            Answer("FAILURE", "nobody", "!found_by_{detect_node}"),
        ),
        facts={"found_by_{detect_node}": False},
    ),
    _condition(
        f"{_HERE}.conditions:IsSurvivorDetected",
        "Did the last search find a survivor? SUCCESS if so, else FAILURE.",
        reference("detect_node", _SEARCH, "The search whose answer counts."),
        answers=(
            Answer("SUCCESS", "yes", "found_by_{detect_node}"),
            Answer("FAILURE", "no", "!found_by_{detect_node}"),
        ),
        facts={"found_by_{detect_node}": False},
    ),
    _condition(
        f"{_HERE}.conditions:MissionComplete",
        "Is the mission complete: every zone visited, every survivor acknowledged, the robot home? SUCCESS if so.",
        handed_over("record", _RECORD, "What has happened in the mission."),
        handed_over("zone_manager", _ZONES, "The mission's zones."),
        answers=(
            Answer("SUCCESS", "complete", _COMPLETE),
            Answer("FAILURE", "incomplete", f"!({_COMPLETE})"),
        ),
        facts={"zones_left": 3, "zones_abandoned": 0, "reports_kept": 0, "at": ""},
    ),
    _condition(
        f"{_HERE}.failsafes:NotAborted",
        "Has the operator not aborted the mission? FAILURE since the service `~/abort` (`std_srvs/srv/Trigger`) was called.",
        handed_over("orders", _ORDERS, "The commands that were given."),
        handed_over("record", _RECORD, "Where the reason is noted.", required=False),
        answers=(Answer("SUCCESS", "not aborted"), Answer("FAILURE", "aborted")),
    ),
    _condition(
        f"{_HERE}.failsafes:NotRecalled",
        "Has the operator not called the robot home? FAILURE since `~/go_home` (`std_srvs/srv/Trigger`) was called.",
        handed_over("orders", _ORDERS, "The commands that were given."),
        handed_over("record", _RECORD, "Where the reason is noted.", required=False),
        answers=(Answer("SUCCESS", "not recalled"), Answer("FAILURE", "recalled")),
    ),
    _condition(
        f"{_HERE}.failsafes:NavigationAvailable",
        "Did somebody judge the last drive? FAILURE if it has failed, or was cut off, while Nav2 or its localisation was away.",
        handed_over("record", _RECORD, "Knows it, and where the reason is noted.", required=False),
        answers=(
            Answer("SUCCESS", "available", "!navigation_lost"),
            Answer("FAILURE", "unavailable", "navigation_lost"),
        ),
        facts={"navigation_lost": False},
    ),
    _condition(
        f"{_HERE}.failsafes:BatterySuffices",
        "Is there enough in the battery? FAILURE below a limit, or if it is not known for too long.",
        handed_over("record", _RECORD, "Where the reason is noted.", required=False),
        attribute("at_least", _SHARE, "The limit, of 1 for a full battery.", 0.2),
        attribute(
            "topic",
            str,
            "A topic of `sensor_msgs/msg/BatteryState`, whose `percentage` counts.",
            "battery_state",
        ),
        attribute("max_age_sec", Seconds, "How long it may be silent, seconds of the node's clock.", 30.0),
        handed_over("homing", _HOMING, "What it takes to come home; is told the limit.", required=False),
        uses=(Use.topic("{topic}"),),
        answers=(Answer("SUCCESS", "enough"), Answer("FAILURE", "low")),
    ),
    _condition(
        f"{_HERE}.failsafes:InsideFence",
        "Is the robot inside its geofence, the parameter `geofence`? SUCCESS without one, and while nobody knows where the robot is.",
        handed_over("fence", _FENCE, "The geofence."),
        handed_over("record", _RECORD, "Where the reason is noted.", required=False),
        answers=(Answer("SUCCESS", "inside"), Answer("FAILURE", "outside")),
    ),
    _condition(
        f"{_HERE}.failsafes:MissionTimeLeft",
        "Is there time left? FAILURE when it is up; it counts from the first tick on, whatever is halted meanwhile.",
        attribute("limit", Seconds, "How long the mission may take, seconds of the mission's clock."),
        handed_over("clock", Clock, "The clock."),
        handed_over("record", _RECORD, "Where the reason is noted.", required=False),
        answers=(Answer("SUCCESS", "time left"), Answer("FAILURE", "time is up")),
    ),
    _condition(
        f"{_HERE}.failsafes:BaseInReach",
        "Is the base station there? FAILURE if its service was in no network for too long.",
        handed_over("clock", Clock, "The clock of the patience."),
        handed_over("record", _RECORD, "Where the reason is noted.", required=False),
        attribute(
            "service", str, "Its service, of the type `sar_interfaces/srv/ReportSurvivor`.", "report_survivor"
        ),
        attribute("patience", Seconds, "How long it may be away, seconds of the mission's clock.", 60.0),
        uses=(Use.service("{service}"),),
        answers=(
            Answer("SUCCESS", "in reach", then="base_lost = false"),
            Answer("FAILURE", "lost", "base_lost || losses_left > 0", _BASE_LOST),
        ),
        facts={"base_lost": False, "losses_left": 1},
    ),
    _condition(
        f"{_HERE}.operating:NotHeld",
        "Is the robot free to go on? FAILURE from `~/pause` to `~/resume`, and in one tick where the operator has changed the plan.",
        handed_over("orders", _ORDERS, "The commands that were given."),
        handed_over("zone_manager", _ZONES, "The mission's zones."),
        handed_over("fence", _FENCE, "The geofence, for zones that are added.", required=False),
        handed_over("record", _RECORD, "Where orders are noted.", required=False),
        answers=(
            Answer("SUCCESS", "free"),
            Answer("FAILURE", "held", "orders_left > 0", "orders_left -= 1"),
            Answer("FAILURE", "zone skipped", "orders_left > 0 && zones_left > 0", _SKIPPED),
            Answer("FAILURE", "plan changed", "orders_left > 0", "orders_left -= 1"),
        ),
        facts={"orders_left": 1, "zones_left": 3, "zones_abandoned": 0},
    ),
    leaf_spec(
        f"{_HERE}.operating:AwaitStandstill",
        "Wait until the robot stands by its odometry: RUNNING while it moves, for `settle_timeout_sec` at most, then SUCCESS with a warning.",
        answers=(Answer("SUCCESS", "stands"), Answer("RUNNING", "moves")),
    ),
]
