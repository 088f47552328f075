"""What the mission shows on a map."""

from sar_compiler.missions.search_and_rescue.landmarks import mission_landmarks
from sar_compiler.missions.search_and_rescue.record import MissionRecord, Standing
from sar_compiler.missions.search_and_rescue.zone_manager import ZoneManager


def test_zones_survivors_and_the_base_have_their_states():
    zones = ZoneManager(
        [{"id": name, "x": float(x), "y": 0.0, "yaw": 0.0} for x, name in enumerate("abcd")],
        {"x": 9.0, "y": 9.0, "yaw": 0.0},
    )
    record = MissionRecord()
    zones.advance()
    zones.abandon()
    for x, name in ((1.0, "survivor_1"), (20.0, "survivor_2"), (40.0, "survivor_3")):
        record.survivor_found("a", x, 1.0)
        record.survivor_named(name, x, 1.0)
    record.survivor_acknowledged("survivor_1")
    record.survivor_judged("survivor_2", Standing.REJECTED)
    record.report_kept("survivor_3")
    record.survivor_found("a", 60.0, 1.0)
    shown = [(each.kind, each.name, each.state, each.level) for each in mission_landmarks(record, zones)]
    assert shown == [
        ("zone", "a", "visited", 2),
        ("zone", "c", "next", 1),
        ("zone", "d", "to come", 0),
        ("zone", "b", "abandoned", 3),
        ("survivor", "survivor_1", "candidate, acknowledged", 2),
        ("survivor", "survivor_2", "rejected", 3),
        ("survivor", "survivor_3", "candidate, report kept", 1),
        ("survivor", "survivor", "candidate", 1),
        ("base", "base station", "", 0),
    ]
    record.base_reached()
    assert mission_landmarks(record, zones)[-1].level == 2
