"""Going through the list of zones: visited, postponed, and finally abandoned."""

from typing import Annotated

from py_trees.common import Status

from sar_compiler.missions.search_and_rescue.record import MissionRecord
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager
from sar_compiler.nodes.register import register
from sar_compiler.nodes.spec import Kind
from sar_compiler.nodes.values import at_least
from sar_compiler.ros.leaves.leaf import RosLeaf
from sar_compiler.runtime.answers import Answer

Attempts = Annotated[int, at_least(1)]

# Zones are postponed in rounds: a postponed zone is next when all others have been tried. So the number of
# attempts at the current zone is the number of the round; a round is over when all remaining zones have been
# postponed in it.
_FACTS = {"zones_left": 3, "round": 1, "postponed_in_round": 0}
_ROUND_IS_OVER = "postponed_in_round >= zones_left"


@register(
    "AdvanceZone",
    kind=Kind.ACTION,
    outcomes={Status.SUCCESS},
    effects="marks the current zone as visited",
    answers=[
        Answer("SUCCESS", "advanced", "zones_left > 0", "zones_left -= 1"),
        Answer("SUCCESS", "no zone", "zones_left == 0"),
    ],
    facts={"zones_left": 3},
    writes=["at"],
)
class AdvanceZone(RosLeaf):
    """Mark the current zone as visited, so that the next one becomes the current zone.

    Args:
        name: The node's name.
        zone_manager: The mission's zones.
        record: Where the visit is noted.
    """

    def __init__(self, name: str, zone_manager: ZoneManager, *, record: MissionRecord | None = None) -> None:
        super().__init__(name)
        self._zones = zone_manager
        self._record = record or MissionRecord()

    def update(self) -> Status:
        """Advance to the next zone, which is started at once; past the last one nothing is done, and no tick requested."""
        if self._zones.has_remaining():
            self._record.zone_visited(self._zones.current_zone()["id"])
            self._zones.advance()
            self._wake()
        return Status.SUCCESS


@register(
    "PostponeZone",
    kind=Kind.ACTION,
    outcomes={Status.SUCCESS, Status.FAILURE},
    effects="puts the current zone behind all others",
    answers=[
        Answer(
            "SUCCESS",
            "postponed",
            when=f"zones_left > 0 && ({_ROUND_IS_OVER} ? round + 1 : round) < {{attempts}}",
            then=f"round += {_ROUND_IS_OVER} ? 1 : 0; "
            f"postponed_in_round = {_ROUND_IS_OVER} ? 1 : postponed_in_round + 1",
        ),
        Answer(
            "FAILURE",
            "tried often enough",
            when=f"zones_left == 0 || ({_ROUND_IS_OVER} ? round + 1 : round) >= {{attempts}}",
        ),
    ],
    facts=_FACTS,
)
class PostponeZone(RosLeaf):
    """Put the current zone after all others, to try it again later; FAILURE after its last attempt.

    Args:
        zone_manager: The mission's zones.
        attempts: The number of attempts at a zone, 1 or more; after the last one it is not postponed again.
    """

    def __init__(self, name: str, zone_manager: ZoneManager, *, attempts: Attempts = 3) -> None:
        super().__init__(name)
        if attempts < 1:
            message = f"attempts is {attempts}; a zone is tried at least once: write 1 or more"
            raise ValueError(message)
        self._zones = zone_manager
        self._attempts = attempts

    def update(self) -> Status:
        """Postpone the zone, if attempts are left."""
        if not self._zones.has_remaining():
            self.complain(f"'{self.name}' has no zone to postpone: none is left.")
            return Status.FAILURE
        zone_id, attempt = self._zones.current_zone()["id"], self._zones.times_postponed() + 1
        if attempt >= self._attempts:
            self.feedback_message = f"attempt {attempt} on {zone_id} was the last one"
            return Status.FAILURE
        self._zones.postpone()
        self.complain(f"{zone_id} is postponed after attempt {attempt} of {self._attempts}.")
        return Status.SUCCESS


@register(
    "AbandonZone",
    kind=Kind.ACTION,
    outcomes={Status.SUCCESS},
    effects="takes the current zone out of the plan, unvisited",
    answers=[
        Answer("SUCCESS", "abandoned", "zones_left > 0", "zones_left -= 1; zones_abandoned += 1"),
        Answer("SUCCESS", "no zone", "zones_left == 0"),
    ],
    facts={"zones_left": 3, "zones_abandoned": 0},
)
class AbandonZone(RosLeaf):
    """Take the current zone out of the plan, unvisited; the mission can then no longer be complete.

    Args:
        zone_manager: The mission's zones.
        record: Where it is noted.
    """

    def __init__(self, name: str, zone_manager: ZoneManager, *, record: MissionRecord | None = None) -> None:
        super().__init__(name)
        self._zones = zone_manager
        self._record = record or MissionRecord()

    def update(self) -> Status:
        """Abandon the zone; past the last one there is nothing to do."""
        if self._zones.has_remaining():
            zone_id, attempts = self._zones.current_zone()["id"], self._zones.times_postponed() + 1
            self._zones.abandon()
            self._record.zone_abandoned(zone_id, attempts)
            self.complain(f"{zone_id} is abandoned after attempt {attempts}.")
        return Status.SUCCESS


@register(
    "AbandonZones",
    kind=Kind.ACTION,
    outcomes={Status.SUCCESS},
    effects="takes all zones that are left out of the plan, unvisited",
    answers=[Answer("SUCCESS", "abandoned", then="zones_abandoned += zones_left; zones_left = 0")],
    facts={"zones_left": 3, "zones_abandoned": 0},
)
class AbandonZones(RosLeaf):
    """Take all zones that are left out of the plan, unvisited, for the reason that a failsafe has given.

    Args:
        zone_manager: The mission's zones.
        record: Where it is noted; knows the reason.
    """

    def __init__(self, name: str, zone_manager: ZoneManager, *, record: MissionRecord | None = None) -> None:
        super().__init__(name)
        self._zones = zone_manager
        self._record = record or MissionRecord()

    def update(self) -> Status:
        """Abandon the zones, if any are left."""
        reason = self._record.alarm or "the tree has cut the mission short"
        for zone in self._zones.remaining_zones():
            self._zones.abandon(reason)
            self._record.zone_given_up(zone["id"], reason)
            self.complain(f"{zone['id']} is given up: {reason}.")
        return Status.SUCCESS
