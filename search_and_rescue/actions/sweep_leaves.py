"""Leaves that sweep the ground of a zone piece by piece. Further passes search the remaining gaps."""

import itertools
import math
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from typing import Annotated, Any

from py_trees.common import Status

from sar_compiler.leaves import (
    SUCCEEDED,
    Clock,
    Kind,
    Outcome,
    RobotEstimate,
    RosLeaf,
    Use,
    at_least,
    plausible_number,
    register,
    remaining_poses,
    robot_estimate,
)
from search_and_rescue.actions.navigation import OF_PLANNER, NavigateTo, drive_outcomes, error_code
from search_and_rescue.actions.survivors import DetectSurvivor, map_extent_of
from search_and_rescue.background_calls import run_in_background
from search_and_rescue.drawn_areas import DrawingError, DrawnAreas
from search_and_rescue.homing_estimates import HomingEstimator
from search_and_rescue.operator_commands import OperatorCommands
from search_and_rescue.record import MissionRecord
from search_and_rescue.search_theory import COVERAGE, Corners, parallel_sweep_pod, random_search_pod
from search_and_rescue.sweep_record import SweepState, SweepStates
from search_and_rescue.sweeps import SweepPattern, sweep
from search_and_rescue.zone_manager import Geofence, MapPose, ZoneManager

Passes = Annotated[int, at_least(1)]
Share = Annotated[float, plausible_number(0, 1)]
# The number of pieces is unknown before the run, so the outcome of a leaf says whether a piece is open. Verification assumes
# `more_pieces` additional pieces beyond one per pass.
_PIECES = {"zones_left": 3, "piece_open": False, "more_pieces": 1}
# If no zone is left, no piece is open, even if pieces were planned.
_OPEN = "zones_left > 0 && piece_open"

# Positions closer together than this are the same position, metres.
_STANDS_M = 0.05
# A change of position above this distance, metres, and above this speed, m/s, is a jump of the localisation.
_JUMP_M, _FASTEST_MPS = 2.0, 1.5
# By default, Nav2 regards a pose as passed within 0.7 m. If the robot stayed farther away than this, metres, it did not pass the pose.
_PASSES_M = 3.0


@dataclass(eq=False, repr=False)
class _SweepLeaf(RosLeaf):
    """The base class of the leaves for the ground of the current zone.

    Args:
        zone_manager: The mission's zones.
        sweeps: The mission's sweeps.
    """

    name: str
    zone_manager: ZoneManager
    sweeps: SweepStates

    def __post_init__(self) -> None:
        super().__init__(self.name)

    @property
    def _zone(self) -> str:
        """The ID of the current zone, or an empty string if no zone is left."""
        return self.zone_manager.current_zone()["id"] if self.zone_manager.has_remaining() else ""


@register(
    "ZoneHasGround",
    kind=Kind.CONDITION,
    outcomes=(Outcome("SUCCESS", "yes", "zones_left > 0"), Outcome("FAILURE", "no")),
    facts={"zones_left": 3},
)
class ZoneHasGround(_SweepLeaf):
    """Check that the current zone has a polygon, which is necessary for a sweep. Otherwise the leaf fails."""

    def update(self) -> Status:
        """Return SUCCESS if the current zone has a polygon, otherwise FAILURE."""
        return Status.SUCCESS if self._zone in self.sweeps.grounds else Status.FAILURE


@register(
    "PiecesRemaining",
    kind=Kind.CONDITION,
    outcomes=(
        Outcome("SUCCESS", "some left", _OPEN),
        Outcome("FAILURE", "none left", f"!({_OPEN})"),
    ),
    facts=_PIECES,
)
class PiecesRemaining(_SweepLeaf):
    """Check that the current zone's sweep has an open piece. The leaf fails if all pieces are done."""

    def update(self) -> Status:
        """Return SUCCESS if the sweep of the current zone has an open piece, otherwise FAILURE."""
        sweep = self.sweeps.state_of(self._zone)
        self.feedback_message = f"{sweep.done} of {len(sweep.pieces)} pieces done"
        return Status.SUCCESS if sweep.open_count else Status.FAILURE


@dataclass(eq=False, repr=False)
class _PlanLeaf(_SweepLeaf):
    """The base class of the leaves that plan pieces. They plan in the background, and are RUNNING meanwhile.

    Args:
        clearance: Distance of pieces from obstacles, metres.
    """

    _: KW_ONLY
    clearance: Annotated[float, plausible_number(0)] = 0.3

    def __post_init__(self) -> None:
        super().__post_init__()
        self._under_way: tuple[str, str, float, Future[list[MapPose]]] | None = None

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the map."""
        super().setup(**kwargs)
        map_extent_of(self.node)

    def update(self) -> Status:
        """Start planning, or record the finished plan."""
        zone = self._zone
        if not zone:
            return self.outcome(Status.FAILURE, "no zone")
        if self.sweeps.state_of(zone).open_count:
            return self.outcome(Status.SUCCESS, "going on")
        if self._under_way is None or self._under_way[0] != zone:
            return self._begin(zone)
        if not self._under_way[-1].done():
            return self.outcome(Status.RUNNING, "planning")
        return self._on_plan(*self._under_way)

    def terminate(self, new_status: Status) -> None:
        """If the leaf is halted, discard the plan."""
        if new_status is Status.INVALID:
            self._under_way = None

    def _begin(self, zone: str) -> Status:
        raise NotImplementedError

    def _plan(
        self, zone: str, told: str, polygons: "list[Corners]", pattern: SweepPattern, coverage: float
    ) -> Status:
        spacing = self.sweeps.grounds[zone].sweep_width / coverage
        obstacles, datum = map_extent_of(self.node).obstacles(), self.zone_manager.current_zone()
        if obstacles is None:
            self.warn(
                f"No map has been received: the sweep of {zone} is planned as if there were no obstacles."
            )
        future = run_in_background(
            self._wake, sweep, polygons, pattern, spacing, datum, obstacles, self.clearance
        )
        self._under_way = zone, told, spacing, future
        return self.outcome(Status.RUNNING, "planning")

    def _on_refusal(self, why: str) -> Status:
        self.warn(why)
        return self.outcome(Status.FAILURE, "nothing to sweep")

    def _on_plan(self, zone: str, told: str, spacing: float, future: "Future[list[MapPose]]") -> Status:
        self._under_way = None
        try:
            pieces = future.result()
        except ValueError as error:
            return self._on_refusal(f"{zone} cannot be swept: {error}.")
        self.sweeps.plan(zone, told, spacing, pieces)
        coverage = self.sweeps.grounds[zone].sweep_width / spacing
        least, most = random_search_pod(coverage), parallel_sweep_pod(coverage)
        self.log(
            f"{zone} is swept in {len(pieces)} pieces ({told}, {spacing:.2f} m apart). The POD is at least {least:.0%}, and {most:.0%} if the robot follows the legs exactly."
        )
        return self.outcome(Status.SUCCESS, "planned")


@register(
    "PlanSweep",
    kind=Kind.ACTION,
    effects="plans the pieces of a sweep",
    outcomes=(
        Outcome("SUCCESS", "planned", "zones_left > 0", "piece_open = true"),
        Outcome("SUCCESS", "going on", "zones_left > 0", "piece_open = true"),
        Outcome("SUCCESS", "swept before", "zones_left > 0", "piece_open = false"),
        Outcome("FAILURE", "nothing to sweep", "zones_left > 0"),
        Outcome("FAILURE", "no zone", "zones_left == 0"),
        Outcome("RUNNING", "planning", "zones_left > 0"),
    ),
    facts=_PIECES,
)
@dataclass(eq=False, repr=False)
class PlanSweep(_PlanLeaf):
    """Plan the sweep of the current zone's ground. A sweep that is already planned continues at the open piece.

    The leaf fails if the robot cannot drive to any part of the ground.

    Args:
        orders: Accepts the operator's areas through the service `~/add_area` (`sar_interfaces/srv/AddArea`).
        fence: The geofence that drawn areas must respect.
        pattern: The pattern: `parallel` legs along the long side, a `creeping_line` along the short side, an `expanding_square` around the zone's
            pose, or the diameters of a `sector` search through it.
        coverage: The coverage, which is the sweep width divided by the distance between legs.
        clearance: Distance of pieces from obstacles, metres.
    """

    pattern: SweepPattern = "parallel"
    coverage: Annotated[float, plausible_number(0, is_open=True)] = COVERAGE
    orders: OperatorCommands = field(default_factory=OperatorCommands)
    fence: Geofence = field(default_factory=Geofence)

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the map, and offer the service through which the operator adds areas."""
        super().setup(**kwargs)
        extent = map_extent_of(self.node)
        drawn = DrawnAreas(self.zone_manager, self.sweeps, self.fence, extent.why_impossible)
        self.orders.offer(self.node, "add_area", partial(self._on_area, drawn))

    def shutdown(self) -> None:
        """Withdraw the service, and release the ROS node."""
        self.orders.destroy_services()
        super().shutdown()

    def _on_area(self, drawn: DrawnAreas, request: Any, response: Any) -> Any:
        """Accept an area drawn by the operator. The area takes effect when the next zone is chosen."""
        try:
            response.success, response.message = True, drawn.add_area(request)
        except DrawingError as error:
            response.success, response.message = False, str(error)
            self.warn(self.orders.line("add_area", f"refused, {error}"))
        else:
            self.log(self.orders.line("add_area", response.message))
        return response

    def _begin(self, zone: str) -> Status:
        if zone not in self.sweeps.grounds:
            return self._on_refusal(f"{zone} cannot be swept: it has no polygon.")
        if not self.coverage > 0.0:
            legs = "write a coverage above 0, for example 0.9"
            return self._on_refusal(f"{zone} cannot be swept: coverage is {self.coverage:g}; {legs}.")
        if self.sweeps.state_of(zone).passes:
            return self.outcome(Status.SUCCESS, "swept before")
        ground = [self.sweeps.grounds[zone].polygon]
        return self._plan(zone, self.pattern, ground, self.pattern, self.coverage)


@register(
    "RefineSweep",
    kind=Kind.ACTION,
    effects="plans the pieces of a further pass",
    outcomes=(
        Outcome("SUCCESS", "planned", "zones_left > 0 && !piece_open", "piece_open = true"),
        Outcome("SUCCESS", "going on", _OPEN),
        Outcome("FAILURE", "nothing to sweep", "zones_left > 0 && !piece_open"),
        Outcome("FAILURE", "no zone", "zones_left == 0"),
        Outcome("RUNNING", "planning", "zones_left > 0 && !piece_open"),
    ),
    facts=_PIECES,
)
@dataclass(eq=False, repr=False)
class RefineSweep(_PlanLeaf):
    """Plan another pass over the gaps in the sweep of the current zone. The leaf succeeds if there are gaps.

    The leaf fails if the zone has the required POD, if all passes were made, or if no gap can be reached.

    Args:
        until_pod: Required probability of detection of the zone, 0 to 1.
        max_passes: Maximum number of passes, including the first one.
        clearance: Distance of pieces from obstacles, metres.
    """

    until_pod: Share = 0.8
    max_passes: Passes = 3

    def _begin(self, zone: str) -> Status:
        swept = self.sweeps.state_of(zone)
        if zone not in self.sweeps.grounds or swept.pod >= self.until_pod or swept.passes >= self.max_passes:
            self.feedback_message = f"{zone}: POD {swept.pod:.0%} after {swept.passes} passes"
            return self.outcome(Status.FAILURE, "nothing to sweep")
        gaps = self.sweeps.raster(zone, map_extent_of(self.node).obstacles()).gaps(self.until_pod)
        if not gaps:
            self.feedback_message = f"{zone}: the gaps are too scattered to be swept, or not on the map"
            return self.outcome(Status.FAILURE, "nothing to sweep")
        return self._plan(zone, "gaps", gaps, "parallel", 1.0)


@register(
    "NavigateToPiece",
    kind=Kind.ACTION,
    effects="drives the robot to the current piece",
    uses=(Use.action("{action}"), Use.nav2()),
    outcomes=drive_outcomes(
        Outcome("SUCCESS", "arrived", _OPEN, "at = 'zone'; navigation_lost = false"),
        Outcome("FAILURE", "no piece", f"!({_OPEN})"),
    ),
    facts={**_PIECES, "at": "", "navigation_lost": False},
)
@dataclass(eq=False, repr=False, kw_only=True)
class NavigateToPiece(NavigateTo):
    """Drive to the current piece of the sweep, and record the ground that the robot sees on the way.

    The leaf is RUNNING on the way, succeeds on arrival, and fails if the robot does not arrive.

    Args:
        sweeps: The mission's sweeps.
    """

    sweeps: SweepStates

    def __post_init__(self) -> None:
        super().__post_init__()
        self._robot: RobotEstimate | None = None
        self._place: tuple[float, float] | None = None
        self._track: list[tuple[float, float]] = []
        self._looked_at = math.inf
        self._zone_id = ""

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the map and to the robot's position."""
        super().setup(**kwargs)
        map_extent_of(self.node)
        self._robot = robot_estimate(self.node)

    def goal(self) -> Any:
        """Return the goal for the current piece, SUCCESS if it was already searched, or FAILURE if none is open."""
        zone = self.zone_manager.current_zone()["id"] if self.zone_manager.has_remaining() else ""
        sweep = self.sweeps.state_of(zone)
        if not sweep.open_count:
            self.warn(f"'{self.name}' has no target: no piece is open.")
            return self.outcome(Status.FAILURE, "no piece")
        self._zone_id, self._place, self._track = zone, None, []
        # The target contains the pass, because a failure in one pass says nothing about the pieces of another pass.
        again = f", pass {sweep.passes}" if sweep.passes > 1 else ""
        return self._set_out(zone, sweep, again)

    def _set_out(self, zone: str, sweep: SweepState, again: str) -> Any:
        piece = f"{sweep.describe_piece(zone)}{again}"
        if self.record.before.has_searched(zone):
            self.feedback_message = f"{piece} was searched in an earlier run"
            return Status.SUCCESS
        self._note_start(zone)
        return self._drive_to(piece, sweep.pieces[sweep.done])

    def _note_start(self, zone: str) -> None:
        if self.record.zone != zone:
            self.record.zone_started(zone)

    def update(self) -> Status:
        """Return the leaf's status. Record the ground that the robot has seen since the last update."""
        status = super().update()
        self._add_seen_ground()
        return status

    def _robot_pose(self) -> tuple[float, float, float] | None:
        return self._robot.last_pose() if self._robot is not None else None

    def _add_seen_ground(self) -> None:
        # The limit for a jump grows with the time since the last update, which can be long with fast simulated time.
        now = self._clock.now()
        passed, self._looked_at = now - self._looked_at, now
        place = self._robot_pose()
        if place is None or not self._zone_id:
            return
        here = place[:2]
        if not self._track or math.dist(self._track[-1], here) >= _STANDS_M:
            self._track.append(here)
        before, self._place = self._place or here, here
        far = math.dist(before, here)
        if far < _STANDS_M:
            self._place = before
        elif far < max(_JUMP_M, _FASTEST_MPS * passed):
            obstacles = map_extent_of(self.node).obstacles()
            self.sweeps.drive(self._zone_id, [before, here], obstacles)


@register(
    "NavigateThroughPieces",
    kind=Kind.ACTION,
    effects="drives the robot through the pieces, and marks them as swept",
    # The action is not listed, because the start must not wait for a server that may not offer it.
    uses=(Use.nav2(),),
    outcomes=drive_outcomes(
        Outcome("SUCCESS", "all done", _OPEN, "piece_open = false; at = 'zone'; navigation_lost = false"),
        Outcome("FAILURE", "no piece", f"!({_OPEN})"),
        Outcome("FAILURE", "piece by piece", _OPEN),
    ),
    facts={**_PIECES, "at": "", "navigation_lost": False},
)
@dataclass(eq=False, repr=False, kw_only=True)
class NavigateThroughPieces(NavigateToPiece):
    """Drive through all open pieces of the sweep without stopping, and mark each passed piece as swept.

    The leaf is RUNNING on the way, succeeds when the last piece is passed, and fails if the robot does not
    arrive. The leaf fails at once if the robot must drive to the pieces one by one: if no server offers the
    action, if an earlier run searched the open piece, or, until a piece is skipped, if the planner has found no
    path through all pieces. The leaf fails on the way if the next piece and the way home would use the
    battery's reserve.

    Args:
        homing: Estimates battery and time for the way home; used if the tree checks the way home.
        clock: The mission's clock.
        until_pod: Probability of detection, 0 to 1. Ground with a lower probability of detection is a gap.
    """

    homing: HomingEstimator
    clock: Clock
    action: str = "navigate_through_poses"
    until_pod: Share = 0.8

    action_type = "nav2_msgs/action/NavigateThroughPoses"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._end = 0
        self._refused: tuple[str, int, int] | None = None

    def _set_out(self, zone: str, sweep: SweepState, again: str) -> Any:
        served = self._port is not None and self._port.statuses.servers()
        refused = self._refused == _plan_of(zone, sweep)
        if not served or refused or self.record.before.has_searched(zone):
            return self._mark_remaining()
        self._note_start(zone)
        self._end = len(sweep.pieces)
        pieces = f"pieces {sweep.done + 1} to {self._end} of {zone}{again}"
        return self._drive_to(pieces, *sweep.pieces[sweep.done :])

    def _message_to(self, poses: Sequence[Any]) -> Any:
        goal = self.interface.Goal()
        # From ROS 2 Kilted on, the poses are in a message of their own.
        if hasattr(goal.poses, "goals"):
            goal.poses.goals = poses
        else:
            goal.poses = poses
        return goal

    def on_feedback(self, feedback: Any) -> Status | None:
        """Show the remaining distance, and mark the passed pieces as swept."""
        super().on_feedback(feedback)
        self._add_seen_ground()
        # Nav2 never reports the last pose as passed; the result does.
        passed = (left := remaining_poses(feedback)) > 0 and self._mark_swept(left)
        if not (passed and self.homing.is_asked):
            return None
        if (here := self._robot_pose()) is not None:
            self.homing.place = MapPose(x=here[0], y=here[1], yaw=here[2])
        return self._mark_remaining() if self.homing.shortage(self.clock.now()) else None

    def on_result(self, status: int, result: Any) -> Status:
        """If the drive succeeded, mark all pieces and return SUCCESS. Otherwise log the reason and return FAILURE."""
        self._add_seen_ground()
        if status != SUCCEEDED:
            if error_code(result) in OF_PLANNER:
                self._refused = _plan_of(self._zone_id, self.sweeps.state_of(self._zone_id))
            return super().on_result(status, result)
        self._mark_swept(0)
        self.log(self.sweeps.state_of(self._zone_id).result(self._zone_id))
        super().on_result(status, result)
        return self.outcome(Status.SUCCESS, "all done")

    def _mark_swept(self, left: int) -> bool:
        """Mark pieces as swept until `left` of the sent pieces remain. Return whether any piece was marked."""
        before = self.sweeps.state_of(self._zone_id).done
        for number in range(before, self._end - left):
            # The arrival at the last piece was checked against the localisation.
            if left and not self._passed_near(self.sweeps.state_of(self._zone_id).pieces[number]):
                return number > before
            # A detection on the way has ended the drive.
            self.record.zone_searched(self._zone_id, None)
            self.sweeps.finish_piece(self._zone_id, map_extent_of(self.node).obstacles(), self.until_pod)
            self._track = self._track[-1:]
        return self._end - left > before

    def _passed_near(self, piece: MapPose) -> bool:
        """Return whether the robot passed a piece. Return True if the track of the robot is unknown."""
        there, track = (piece["x"], piece["y"]), self._track
        steps = itertools.pairwise(track if len(track) > 1 else track * 2)
        return not track or min(_distance_to(there, *step) for step in steps) <= _PASSES_M

    def _mark_remaining(self) -> Status:
        self.feedback_message = "piece by piece"
        return self.outcome(Status.FAILURE, "piece by piece")


def _distance_to(point: tuple[float, float], start: tuple[float, float], end: tuple[float, float]) -> float:
    """Return the distance between a point and the line segment from *start* to *end*, in metres."""
    (x, y), along = start, (end[0] - start[0], end[1] - start[1])
    length = math.hypot(*along)
    share = ((point[0] - x) * along[0] + (point[1] - y) * along[1]) / length**2 if length else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.dist(point, (x + share * along[0], y + share * along[1]))


def _plan_of(zone: str, sweep: SweepState) -> tuple[str, int, int]:
    """Return a value that identifies the plan of a zone. Skipping a piece changes this value."""
    return zone, sweep.passes, sweep.skipped


@register(
    "AdvancePiece",
    kind=Kind.ACTION,
    effects="marks the current piece as swept",
    outcomes=(
        Outcome("SUCCESS", "advanced", f"{_OPEN} && more_pieces > 0", "more_pieces -= 1"),
        Outcome("SUCCESS", "all done", _OPEN, "piece_open = false"),
        Outcome("SUCCESS", "no piece", f"!({_OPEN})"),
    ),
    facts=_PIECES,
)
@dataclass(eq=False, repr=False)
class AdvancePiece(_SweepLeaf):
    """Mark the current piece as swept, record the ground that was seen, and make the next piece current.

    Args:
        until_pod: Probability of detection, 0 to 1. Ground with a lower probability of detection is a gap.
    """

    _: KW_ONLY
    until_pod: Share = 0.8

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the map."""
        super().setup(**kwargs)
        map_extent_of(self.node)

    def update(self) -> Status:
        """Finish the current piece. After the last piece of a pass, log the result of the sweep."""
        zone = self._zone
        if not self.sweeps.state_of(zone).open_count:
            return self.outcome(Status.SUCCESS, "no piece")
        self.sweeps.finish_piece(zone, map_extent_of(self.node).obstacles(), self.until_pod)
        sweep = self.sweeps.state_of(zone)
        if not sweep.open_count:
            self.log(sweep.result(zone))
        self._wake()
        return self.outcome(Status.SUCCESS, "advanced" if sweep.open_count else "all done")


@register(
    "SkipPiece",
    kind=Kind.ACTION,
    effects="skips the current piece",
    outcomes=(
        Outcome("SUCCESS", "skipped", f"{_OPEN} && more_pieces > 0", "more_pieces -= 1"),
        Outcome("SUCCESS", "skipped the last", _OPEN, "piece_open = false"),
        Outcome("SUCCESS", "no piece", f"!({_OPEN})"),
    ),
    facts=_PIECES,
)
class SkipPiece(_SweepLeaf):
    """Skip the current piece, which cannot be reached or searched. The next piece becomes the current piece."""

    def update(self) -> Status:
        """Skip the current piece."""
        zone = self._zone
        sweep = self.sweeps.state_of(zone)
        if not sweep.open_count:
            return self.outcome(Status.SUCCESS, "no piece")
        self.warn(f"Skipping {sweep.describe_piece(zone)}.")
        self.sweeps.skip(zone, "too far for a battery, not reached, or not searched")
        return self.outcome(
            Status.SUCCESS, "skipped" if self.sweeps.state_of(zone).open_count else "skipped the last"
        )


@register(
    "IsFindNew",
    kind=Kind.CONDITION,
    outcomes=(
        Outcome("SUCCESS", "new", "found_by_{detect_node}"),
        Outcome("FAILURE", "known", "found_by_{detect_node}"),
        Outcome("FAILURE", "nobody", "!found_by_{detect_node}"),
    ),
    facts={"found_by_{detect_node}": False},
)
@dataclass(eq=False, repr=False)
class IsFindNew(RosLeaf):
    """Check that the survivor found by the last search is new. The leaf fails if the survivor is already known.

    During a sweep the same survivor is detected from several pieces, at slightly different positions.

    Args:
        detect_node: The search whose result is checked.
        record: The survivors detected before.
        same_within: Distance below which two detections are the same survivor, metres.
    """

    name: str
    detect_node: DetectSurvivor
    record: MissionRecord
    _: KW_ONLY
    same_within: float = 1.0

    def __post_init__(self) -> None:
        super().__init__(self.name)

    def update(self) -> Status:
        """Compare the detected survivor with the survivors that were detected before."""
        place = self.detect_node.survivor_pose()
        if place is None:
            return self.outcome(Status.FAILURE, "nobody")
        known = self.record.survivors_near(*place, self.same_within)
        near = next((each for each in known if each.counts), None)
        if near is None or self.record.before.has_open_name(*place):
            return self.outcome(Status.SUCCESS, "new")
        self.feedback_message = f"{near.survivor_id} was detected before"
        return self.outcome(Status.FAILURE, "known")
