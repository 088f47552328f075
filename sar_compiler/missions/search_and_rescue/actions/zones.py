"""Going through the list of zones."""

from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.missions.search_and_rescue.record import MissionRecord
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager
from sar_compiler.nodes.register import register
from sar_compiler.nodes.spec import Kind
from sar_compiler.runtime.answers import Answer
from sar_compiler.runtime.leaf_protocol import Wake, stay_asleep


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
class AdvanceZone(Behaviour):
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
        self._wake: Wake = stay_asleep

    def setup(self, **kwargs: Any) -> None:
        """Take `wake`, if given, so that the next zone is started at once."""
        self._wake = kwargs.get("wake", stay_asleep)

    def update(self) -> Status:
        """Advance to the next zone; past the last one there is nothing to do, and no tick is requested."""
        if self._zones.has_remaining():
            self._record.zone_visited(self._zones.current_zone()["id"])
            self._zones.advance()
            self._wake()
        return Status.SUCCESS
