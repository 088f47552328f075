"""A robot's battery: what driving and time take from it, and its swap where the robot has started, or at a charging place."""

from dataclasses import dataclass

from sar_compiler.sim.geometry import Pose2D

# So near to its start a robot is back there, metres; slower than this it stands, m/s.
_BACK_M, _STANDS_MPS = 1.0, 0.01


@dataclass(frozen=True)
class BatteryKind:
    """What a battery is like, in shares of a full one.

    Attributes:
        per_m: What a metre that is driven takes.
        per_sec: What a second takes, driven or not; by default it lasts four hours.
        share: What is in it at time zero.
        swap_sec: How long a robot that is back where it has started, or at one of the places, stands there until it has a full one, seconds;
            None if nobody swaps it.
        places: Where else it is swapped: x and y in metres, frame `map`.
    """

    per_m: float = 0.0
    per_sec: float = 1.0 / (4 * 3600.0)
    share: float = 1.0
    swap_sec: float | None = None
    places: tuple[tuple[float, float], ...] = ()


class Battery:
    """The battery of a robot.

    Args:
        kind: What it is like.
        start: Where the robot is at time zero, frame `map`.

    Attributes:
        share: What is in it, of 1 for a full one.
    """

    def __init__(self, kind: BatteryKind, start: Pose2D) -> None:
        self.share = kind.share
        self._kind, self._at = kind, start
        self._stops = (start, *(Pose2D(x, y) for x, y in kind.places))
        self._was_away, self._stood_sec = False, 0.0

    def step(self, pose: Pose2D, speed: float, duration: float) -> None:
        """Take what a step of the robot takes.

        Args:
            pose: Where the robot is at the end of the step, frame `map`.
            speed: How fast it drives then, m/s.
            duration: How long the step took, seconds.
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
