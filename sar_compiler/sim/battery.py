"""A robot's battery. Driving and time consume charge. The battery is swapped at the robot's start or at a charging location."""

from dataclasses import dataclass

from sar_compiler.sim.geometry import Pose2D

# A battery is swapped only within this distance of a location, metres, and below this speed of the robot, m/s.
_BACK_M, _STANDS_MPS = 1.0, 0.01


@dataclass(frozen=True)
class BatteryKind:
    """The properties of a battery; charges are fractions of a full charge.

    Attributes:
        per_m: Consumption per metre driven.
        per_sec: Consumption per second, driving or not; by default the battery lasts four hours.
        share: The charge at the start of the simulation.
        swap_sec: How long a robot must stand at its start, or at one of *places*, to get a full battery, in seconds; None if the battery is
            not swapped.
        places: Further positions for a swap: x and y in metres, frame `map`.
    """

    per_m: float = 0.0
    per_sec: float = 1.0 / (4 * 3600.0)
    share: float = 1.0
    swap_sec: float | None = None
    places: tuple[tuple[float, float], ...] = ()


class Battery:
    """The battery of a robot.

    Args:
        kind: The properties of the battery.
        start: The robot's pose at time zero, frame `map`.

    Attributes:
        share: The charge, 1 for a full battery.
    """

    def __init__(self, kind: BatteryKind, start: Pose2D) -> None:
        self.share = kind.share
        self._kind, self._at = kind, start
        self._stops = (start, *(Pose2D(x, y) for x, y in kind.places))
        self._was_away, self._stood_sec = False, 0.0

    def step(self, pose: Pose2D, speed: float, duration: float) -> None:
        """Apply the consumption of a step of the robot.

        Args:
            pose: The robot's pose at the end of the step, frame `map`.
            speed: The robot's speed at that time, m/s.
            duration: The duration of the step, seconds.
        """
        moved = self._at.distance_to(pose)
        self._at = pose
        self.share = max(0.0, self.share - moved * self._kind.per_m - duration * self._kind.per_sec)
        is_back = min(stop.distance_to(pose) for stop in self._stops) <= _BACK_M
        self._was_away = self._was_away or not is_back
        stands = is_back and abs(speed) < _STANDS_MPS
        self._stood_sec = self._stood_sec + duration if stands else 0.0
        if self._was_away and self._kind.swap_sec is not None and self._stood_sec >= self._kind.swap_sec:
            self.share, self._was_away = 1.0, False
