"""Estimate how much battery charge and time the robot needs for the next leg and the way home."""

import math

from sar_compiler.missions import Figure, ParameterReader, mission_context
from search_and_rescue.energy import ConsumptionRates, EnergyModel, TripEstimate
from search_and_rescue.search_theory import SearchExpectation
from search_and_rescue.sweep_record import SweepStates
from search_and_rescue.zone_manager import Geofence, MapPose, PosePair, ZoneManager

CHARGING = "charging"
"""The prefix of the parameters that define the poses of charging places."""
ENERGY = "energy"
"""The prefix of the parameters that define the battery consumption."""
RESERVE = 0.15
"""The default charge that must be left when the robot arrives at home; 1 is a full battery."""
PRIOR = ConsumptionRates(per_m=0.0005, per_sec=0.0001)
"""The default battery consumption of a robot."""
_WRONG_BY = EnergyModel.wrong_by
# Maximum distance from the pose of the last search at which planned paths from this pose are used.
_NEAR_M = 1.5
_POSE = ("x", "y", "yaw")
_NAMES = (*ConsumptionRates._fields, "wrong_by", "reserve")


def _preview() -> "HomingEstimator":
    base = MapPose(x=0.0, y=0.0, yaw=0.0)
    return HomingEstimator(ZoneManager([{"id": "zone_a", **base}], base))


@mission_context(preview=_preview)
class HomingEstimator:
    """Estimates the battery charge and time for the way home, from the robot's position or after the next leg.

    Path lengths come from the `ZoneManager`. The search of a piece is assumed to take the zone's `look_sec`,
    divided by the number of pieces.

    Args:
        zones: The mission's zones and base station.
        energy: The model of the robot's battery.
        sweeps: The mission's sweeps.
        reserve: Charge that must be left on arrival at home, 1 for a full battery.
        speed_mps: The robot's speed for estimates of time, m/s.

    Attributes:
        zones: The mission's zones and base station.
        energy: The model of the robot's battery.
        reserve: Charge that must be left on arrival at home, in addition to `ends_below`.
        ends_below: Charge below which a failsafe ends the mission, 1 for a full battery; 0 without such a failsafe.
        place: The robot's last known pose; None if no pose is known.
        is_asked: Whether the tree checks the way home. Only then are `figures` displayed.
        ends_at: Time at which the mission must end, seconds of the mission's clock.
    """

    def __init__(
        self,
        zones: ZoneManager,
        energy: EnergyModel | None = None,
        *,
        sweeps: SweepStates | None = None,
        reserve: float = RESERVE,
        speed_mps: float = 1.0,
    ) -> None:
        self.zones, self._sweeps, self._speed_mps = zones, sweeps or SweepStates(), speed_mps
        self.energy, self.reserve, self.ends_below = energy or EnergyModel(PRIOR), reserve, 0.0
        self.place: MapPose | None = None
        self.is_asked = False
        self.ends_at = math.inf
        self._charges = 0

    @property
    def has_next(self) -> bool:
        """Whether a zone is left to visit."""
        return self.zones.has_remaining()

    @property
    def next_zone(self) -> str:
        """The ID of the zone to visit next.

        Raises:
            IndexError: If every zone is visited.
        """
        return self.zones.current_zone()["id"]

    @property
    def next_leg(self) -> str:
        """The target of the next leg in words, such as `zone_b` or `piece 3/12 of zone_b`.

        Raises:
            IndexError: If every zone is visited.
        """
        sweep = self._sweeps.state_of(self.next_zone)
        return sweep.describe_piece(self.next_zone) if sweep.open_count else self.next_zone

    def required_paths(self) -> list[PosePair]:
        """Return the start and target of each path whose length is needed for the next leg and the way home.

        Raises:
            IndexError: If every zone is visited.
        """
        return self.zones.required_paths([self._target()[0]], between=False)

    def _target(self) -> tuple[MapPose, float]:
        """Return the target of the next leg, and the duration of the search there in seconds."""
        zone = self.zones.current_zone()
        look_sec = self.zones.areas.get(zone["id"], SearchExpectation(0.0, 0.0)).look_sec
        sweep = self._sweeps.state_of(zone["id"])
        return (
            (sweep.pieces[sweep.done], look_sec / len(sweep.pieces)) if sweep.open_count else (zone, look_sec)
        )

    def await_charge(self) -> None:
        """Start to wait for a charged or swapped battery. Until then, `is_charged` is False."""
        self._charges = self.energy.charges

    @property
    def is_charged(self) -> bool:
        """Whether the battery has been charged or swapped since the last call of `await_charge`."""
        return self.energy.charges > self._charges

    def home(self) -> TripEstimate:
        """Estimate the trip from the robot's position to the base station."""
        return self._drive(self._trip_from_robot(self.zones.base_pose()))

    def leg(self, start: MapPose | None = None) -> TripEstimate:
        """Estimate the drive to the current zone or piece, the search there, and the way home.

        Args:
            start: The start of the trip; None for the robot's position.

        Raises:
            IndexError: If every zone is visited.
        """
        target, look_sec = self._target()
        out = self.zones.path_length_m(start, target) if start is not None else self._trip_from_robot(target)
        return self._drive(out + self.zones.path_length_m(target, self.zones.base_pose()), look_sec)

    def _trip_from_robot(self, target: MapPose) -> float:
        searched = self.zones.last_pose()
        apart = self.zones.path_length_m(self.place, searched) if self.place is not None else 0.0
        # The planner's paths start at the pose of the last search. Near this pose they are more accurate than a straight line.
        if self.place is None or apart <= _NEAR_M:
            return apart + self.zones.path_length_m(searched, target)
        return self.zones.path_length_m(self.place, target)

    def _drive(self, metres: float, waited_sec: float = 0.0) -> TripEstimate:
        return TripEstimate(metres, metres / self._speed_mps + waited_sec)

    @property
    def spare_charge(self) -> float:
        """The charge above the reserve and the failsafe's limit, 1 for a full battery. May be negative."""
        return self.energy.share - self._reserve

    @property
    def _reserve(self) -> float:
        return self.reserve + self.ends_below

    def late(self, now: float) -> str:
        """Return why the mission time is too short for the next leg and the way home; empty if there is enough time.

        Args:
            now: The current time, seconds of the mission's clock.

        Raises:
            IndexError: If every zone is visited.
        """
        needed, left = self.leg().seconds, self.ends_at - now
        if needed <= left:
            return ""
        return f"{self.next_leg} and the way home need {needed:.0f} s, but only {max(0.0, left):.0f} s of the mission time are left"

    def shortage(self, now: float = 0.0) -> str:
        """Return why the charge or time is too low for the next leg and the way home; empty if both suffice.

        Args:
            now: The current time, seconds of the mission's clock.

        Raises:
            IndexError: If every zone is visited.
        """
        trip = self.leg()
        need = self.energy.need(trip)
        if need <= self.spare_charge:
            return self.late(now)
        above = f" above the limit of {self.ends_below:.0%} that ends the mission" if self.ends_below else ""
        return f"{self.next_leg} needs {need:.0%} of a full battery ({trip.metres:.0f} m, {trip.seconds:.0f} s), but the battery is at {self.energy.share:.0%}, and the reserve is {self.reserve:.0%}{above}"

    def charging_stop(self) -> tuple[str, MapPose]:
        """Return the ID and the pose of the best place for charging. The ID of the base station is empty.

        The best place is the nearest one that the robot reaches without using the reserve. Places from which a full battery suffices for the
        next leg are preferred. If no charging place is reachable, the base station is returned. It is assumed
        to be reachable, because every leg is planned so that the robot can return to it.
        """
        stops = self._reachable_stops()
        useful = {
            name: pose for name, pose in stops.items() if self.has_next and self._full_battery_suffices(pose)
        }
        among = useful or stops
        name = min(among, key=lambda each: self._trip_from_robot(among[each]))
        return name, among[name]

    def trip_to(self, pose: MapPose) -> TripEstimate:
        """Estimate the trip from the robot's position to a pose."""
        return self._drive(self._trip_from_robot(pose))

    def _reachable_stops(self) -> dict[str, MapPose]:
        """Return the poses of all reachable places for charging, by ID. The ID of the base station is empty."""
        near = {name: pose for name, pose in self.zones.charging.items() if self._is_in_reach(pose)}
        base = self.zones.base_pose()
        return {"": base, **near} if not near or self._is_in_reach(base) else near

    def _is_in_reach(self, pose: MapPose) -> bool:
        return self.energy.need(self.trip_to(pose)) <= self.spare_charge

    def _full_battery_suffices(self, start: MapPose) -> bool:
        return self.energy.need(self.leg(start)) <= 1.0 - self._reserve

    def excess(self) -> str:
        """Return why a full battery does not suffice for the next leg and the way home; empty if it suffices.

        Raises:
            IndexError: If every zone is visited.
        """
        if any(map(self._full_battery_suffices, self._reachable_stops().values())):
            return ""
        if self.zones.charging and self.energy.need(self.leg()) <= self.spare_charge:
            # The leg is too long from every place for charging, but the robot is nearer to the target.
            return ""
        trip = self.leg(self.zones.base_pose())
        need = self.energy.need(trip)
        return f"{self.next_leg} needs {need:.0%} of a full battery from home and back ({trip.metres:.0f} m, {trip.seconds:.0f} s), but only {1.0 - self._reserve:.0%} is available above the reserve"

    def shortage_figures(self) -> dict[str, float | None]:
        """Return the data of a shortage event: needs of the next leg (charge, metres, seconds) and battery charge.

        Raises:
            IndexError: If every zone is visited.
        """
        trip, share = self.leg(), self.energy.share
        return {
            "need": round(self.energy.need(trip), 4),
            "metres": round(trip.metres, 1),
            "seconds": round(trip.seconds, 1),
            "share": None if math.isnan(share) else round(share, 4),
        }

    def figures(self) -> list[Figure]:
        """Return the charge needed for the way home, and the distance and time left until the point of no return.

        Figures are only returned after the tree has checked the way home and the battery's charge is known.
        """
        if not self.is_asked or not math.isfinite(self.energy.share):
            return []
        need = self.energy.need(self.home())
        left = max(0.0, self.spare_charge - need)
        # Every metre driven away from home must be driven back.
        metres = left / (2 * self.energy.need(self._drive(1.0)))
        seconds = left / self.energy.need(TripEstimate(0.0, 1.0))
        return [
            Figure("battery for the way home", round(100 * need, 1), unit="%"),
            Figure("metres to the point of no return", round(metres), unit="m"),
            Figure("seconds to the point of no return", round(seconds), unit="s"),
        ]


def read_homing(
    reader: ParameterReader, zones: ZoneManager, sweeps: SweepStates, speed_mps: float
) -> HomingEstimator:
    """Create the estimator from the optional parameters `energy.{per_m,per_sec,wrong_by,reserve}`."""
    reader.report_unknown_names(ENERGY, _NAMES)
    prior = ConsumptionRates(
        *(reader.positive(f"{ENERGY}.{name}", getattr(PRIOR, name)) for name in ConsumptionRates._fields)
    )
    wrong_by = _read_share(reader, "wrong_by", _WRONG_BY)
    return HomingEstimator(
        zones,
        EnergyModel(prior, wrong_by),
        sweeps=sweeps,
        reserve=_read_share(reader, "reserve", RESERVE),
        speed_mps=speed_mps,
    )


def read_charging(reader: ParameterReader, fence: Geofence) -> dict[str, MapPose]:
    """Read the poses of additional charging places from the parameters `charging.<id>.{x,y,yaw}`."""
    places = dict[str, MapPose]()
    for name, given in reader.group(CHARGING, _POSE).items():
        for missing in sorted({"x", "y"} - given):
            reader.report_error(
                f"{CHARGING}.{name}.{missing}", "is missing: add x and y of the charging place, in metres"
            )
        x, y, yaw = (reader.number(f"{CHARGING}.{name}.{axis}", 0.0) for axis in _POSE)
        if not fence.contains(x, y):
            reader.report_error(f"{CHARGING}.{name}.x", f"is at ({x:g}, {y:g}), outside the geofence")
        places[name] = MapPose(x=x, y=y, yaw=yaw)
    return places


def _read_share(reader: ParameterReader, name: str, default: float) -> float:
    value = reader.number(f"{ENERGY}.{name}", default)
    if value == 1.0:
        reader.report_error(f"{ENERGY}.{name}", "is 1: write a share of at least 0 and below 1")
    return value
