"""Whether the robot can go on and come home again: what legs take of the battery and of the time."""

import math

from sar_compiler.missions import Figure, ParameterReader, mission_context
from search_and_rescue.energy import EnergyModel, Rates, Trip
from search_and_rescue.search_theory import Area
from search_and_rescue.sweep_record import Sweeps
from search_and_rescue.zone_manager import Fence, MapPose, PosePair, ZoneManager

CHARGING = "charging"
"""The group of parameters with the poses of charging places."""
ENERGY = "energy"
"""The group of parameters."""
RESERVE = 0.15
"""What is to be left in the battery at home, of 1 for a full one, where the parameters do not say it."""
PRIOR = Rates(per_m=0.0005, per_sec=0.0001)
"""What a robot is expected to use, where the parameters do not say it."""
_WRONG_BY = EnergyModel.wrong_by
_NEAR_M = 1.5
_POSE = ("x", "y", "yaw")
_NAMES = (*Rates._fields, "wrong_by", "reserve")


def _preview() -> "Homing":
    base = MapPose(x=0.0, y=0.0, yaw=0.0)
    return Homing(ZoneManager([{"id": "zone_a", **base}], base))


@mission_context(preview=_preview)
class Homing:
    """What it takes to come home, now and after the next leg: to the current zone, or to the open piece of its sweep.

    Ways are as long as the `ZoneManager` takes them to be. A look at a piece takes its share of the zone's `look_sec`.

    Args:
        zones: The mission's zones and base station.
        energy: What is known of the robot's battery.
        sweeps: The mission's sweeps.
        reserve: What is to be left in it at home, of 1 for a full one.
        speed_mps: How fast the robot drives, for estimates of time, m/s.

    Attributes:
        zones: The mission's zones and base station.
        energy: What is known of the robot's battery.
        reserve: What is to be left in it.
        ends_below: Where a failsafe ends the mission, of 1 for a full battery: the reserve counts above that. 0 if none does.
        place: Where the robot is, as far as anybody has said it.
        is_asked: Whether the tree asks for this, so that it is to be shown.
        ends_at: When the mission's time is up, seconds of the mission's clock.
    """

    def __init__(
        self,
        zones: ZoneManager,
        energy: EnergyModel | None = None,
        *,
        sweeps: Sweeps | None = None,
        reserve: float = RESERVE,
        speed_mps: float = 1.0,
    ) -> None:
        self.zones, self._sweeps, self._speed_mps = zones, sweeps or Sweeps(), speed_mps
        self.energy, self.reserve, self.ends_below = energy or EnergyModel(PRIOR), reserve, 0.0
        self.place: MapPose | None = None
        self.is_asked = False
        self.ends_at = math.inf
        self._charges = 0

    @property
    def has_next(self) -> bool:
        """Whether there is a zone to go on to."""
        return self.zones.has_remaining()

    @property
    def next_zone(self) -> str:
        """The zone to go on to.

        Raises:
            IndexError: If every zone is visited.
        """
        return self.zones.current_zone()["id"]

    @property
    def next_leg(self) -> str:
        """Where the next leg goes, in words.

        Raises:
            IndexError: If every zone is visited.
        """
        sweep = self._sweeps.of(self.next_zone)
        return sweep.told(self.next_zone) if sweep.left else self.next_zone

    def ways(self) -> list[PosePair]:
        """Return the ways by which the next leg is weighed.

        Raises:
            IndexError: If every zone is visited.
        """
        return self.zones.ways([self._target()[0]], between=False)

    def _target(self) -> tuple[MapPose, float]:
        """Return where the next leg goes, and how long a look there takes, seconds."""
        zone = self.zones.current_zone()
        look_sec = self.zones.areas.get(zone["id"], Area(0.0, 0.0)).look_sec
        sweep = self._sweeps.of(zone["id"])
        return (sweep.pieces[sweep.done], look_sec / len(sweep.pieces)) if sweep.left else (zone, look_sec)

    def await_charge(self) -> None:
        """Begin to look whether the battery is charged or swapped."""
        self._charges = self.energy.charges

    @property
    def is_charged(self) -> bool:
        """Whether the battery was charged or swapped since then."""
        return self.energy.charges > self._charges

    def home(self) -> Trip:
        """Return the way home."""
        return self._drive(self._way_from_here(self.zones.base_pose()))

    def leg(self, start: MapPose | None = None) -> Trip:
        """Return the way to the current zone or piece, a look there and the way home from it.

        Args:
            start: Where the robot sets out; where it is if None.

        Raises:
            IndexError: If every zone is visited.
        """
        target, look_sec = self._target()
        out = self.zones.way_m(start, target) if start is not None else self._way_from_here(target)
        return self._drive(out + self.zones.way_m(target, self.zones.base_pose()), look_sec)

    def _way_from_here(self, target: MapPose) -> float:
        looked = self.zones.here()
        apart = self.zones.way_m(self.place, looked) if self.place is not None else 0.0
        # What a planner has said begins where the robot has looked, and is worth more than a straight line from near there.
        if self.place is None or apart <= _NEAR_M:
            return apart + self.zones.way_m(looked, target)
        return self.zones.way_m(self.place, target)

    def _drive(self, metres: float, waited_sec: float = 0.0) -> Trip:
        return Trip(metres, metres / self._speed_mps + waited_sec)

    @property
    def spare(self) -> float:
        """What is in the battery above the reserve, of 1 for a full one."""
        return self.energy.share - self._kept

    @property
    def _kept(self) -> float:
        return self.reserve + self.ends_below

    def late(self, now: float) -> str:
        """Return in words that the mission's time does not suffice for the next leg and the way home; empty if it does.

        Args:
            now: Seconds of the mission's clock.

        Raises:
            IndexError: If every zone is visited.
        """
        needed, left = self.leg().seconds, self.ends_at - now
        if needed <= left:
            return ""
        return f"{self.next_leg} needs {needed:.0f} s out and home, of the mission's time {max(0.0, left):.0f} s are left"

    def shortage(self, now: float = 0.0) -> str:
        """Return in words that battery or time do not suffice for the next leg and the way home; empty if they do.

        Args:
            now: Seconds of the mission's clock.

        Raises:
            IndexError: If every zone is visited.
        """
        trip = self.leg()
        need = self.energy.need(trip)
        if need <= self.spare:
            return self.late(now)
        above = f" above the {self.ends_below:.0%} that end the mission" if self.ends_below else ""
        return (
            f"{self.next_leg} needs {need:.0%} for {trip.metres:.0f} m and {trip.seconds:.0f} s, "
            f"the battery is at {self.energy.share:.0%}, the reserve is {self.reserve:.0%}{above}"
        )

    def charging_stop(self) -> tuple[str, MapPose]:
        """Return where the robot is to have its battery charged: the id of the charging place, empty for home; and its pose.

        It is the nearest place that is reached with the reserve, of those from where a full battery suffices for the current zone if there
        are such. Home counts as reached where no charging place is: no leg begins that does not end there.
        """
        stops = self._stops()
        useful = {name: pose for name, pose in stops.items() if self.has_next and self._suffices_from(pose)}
        among = useful or stops
        name = min(among, key=lambda each: self._way_from_here(among[each]))
        return name, among[name]

    def way_to(self, pose: MapPose) -> Trip:
        """Return the way to a place from where the robot is."""
        return self._drive(self._way_from_here(pose))

    def _stops(self) -> dict[str, MapPose]:
        """Return home, and the charging places that are reached with the reserve; without home if it is not, and one of these is."""
        near = {name: pose for name, pose in self.zones.charging.items() if self._is_reached(pose)}
        base = self.zones.base_pose()
        return {"": base, **near} if not near or self._is_reached(base) else near

    def _is_reached(self, pose: MapPose) -> bool:
        return self.energy.need(self.way_to(pose)) <= self.spare

    def _suffices_from(self, start: MapPose) -> bool:
        return self.energy.need(self.leg(start)) <= 1.0 - self._kept

    def excess(self) -> str:
        """Return in words that not even a full battery suffices for the next leg, from home or a charging place in reach; empty if one does.

        Raises:
            IndexError: If every zone is visited.
        """
        if any(map(self._suffices_from, self._stops().values())):
            return ""
        if self.zones.charging and self.energy.need(self.leg()) <= self.spare:
            # From home it is too far, and the robot is nearer.
            return ""
        trip = self.leg(self.zones.base_pose())
        need = self.energy.need(trip)
        return (
            f"{self.next_leg} needs {need:.0%} for {trip.metres:.0f} m and {trip.seconds:.0f} s from home and back, "
            f"and a full battery leaves {1.0 - self._kept:.0%} above the reserve"
        )

    def weighed(self) -> dict[str, float | None]:
        """Return the figures behind a shortage: what the leg needs of the battery, metres and seconds, and what is in it.

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
        """Return what the way home takes, and how far and how long the robot can go on before it only just comes home.

        None before it is asked for, or anything is known of the battery.
        """
        if not self.is_asked or not math.isfinite(self.energy.share):
            return []
        need = self.energy.need(self.home())
        left = max(0.0, self.spare - need)
        # What is driven away from home has to be driven back.
        metres = left / (2 * self.energy.need(self._drive(1.0)))
        seconds = left / self.energy.need(Trip(0.0, 1.0))
        return [
            Figure("battery to come home", round(100 * need, 1), unit="%"),
            Figure("metres to the point of no return", round(metres), unit="m"),
            Figure("seconds to the point of no return", round(seconds), unit="s"),
        ]


def read_homing(reader: ParameterReader, zones: ZoneManager, sweeps: Sweeps, speed_mps: float) -> Homing:
    """Read the parameters `energy.{per_m,per_sec,wrong_by,reserve}`, all of which have a default."""
    reader.only(ENERGY, _NAMES)
    prior = Rates(*(reader.positive(f"{ENERGY}.{name}", getattr(PRIOR, name)) for name in Rates._fields))
    wrong_by = _share(reader, "wrong_by", _WRONG_BY)
    return Homing(
        zones,
        EnergyModel(prior, wrong_by),
        sweeps=sweeps,
        reserve=_share(reader, "reserve", RESERVE),
        speed_mps=speed_mps,
    )


def read_charging(reader: ParameterReader, fence: Fence) -> dict[str, MapPose]:
    """Read the poses of charging places, `charging.<id>.{x,y,yaw}`; those besides the base station, where there are such."""
    places = dict[str, MapPose]()
    for name, given in reader.group(CHARGING, _POSE).items():
        for missing in sorted({"x", "y"} - given):
            reader.report(
                f"{CHARGING}.{name}.{missing}", "is missing: a charging place has x and y in metres"
            )
        x, y, yaw = (reader.number(f"{CHARGING}.{name}.{axis}", 0.0) for axis in _POSE)
        if not fence.contains(x, y):
            reader.report(f"{CHARGING}.{name}.x", f"has the place ({x:g}, {y:g}) outside the geofence")
        places[name] = MapPose(x=x, y=y, yaw=yaw)
    return places


def _share(reader: ParameterReader, name: str, default: float) -> float:
    value = reader.number(f"{ENERGY}.{name}", default)
    if value == 1.0:
        reader.report(f"{ENERGY}.{name}", "must be a share from 0 to below 1, is 1")
    return value
