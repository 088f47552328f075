"""Tests of operator commands: their values are checked against the declared fields."""

import math

import pytest

from sar_compiler.missions.mission import CommandError, CommandField, OperatorCommand
from search_and_rescue.operator_commands import VERBS

GO = OperatorCommand(
    "go",
    "Go",
    "Goes.",
    fields=(
        CommandField("name", "Name"),
        CommandField("x", "x", "number"),
        CommandField("how", "How", "choice", (("FAST", "fast"), ("SLOW", "slow"))),
        CommandField("whom", "Whom", "found", optional=True),
    ),
)
RIGHT = {"name": "there", "x": 1, "how": "FAST", "whom": ""}


def test_complete_command_is_accepted():
    assert GO.check(RIGHT) == {**RIGHT, "x": 1.0}


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"name": ""}, "go: name is '', but must be a string"),
        ({"name": "a\nb"}, r"go: name is 'a\nb', but must be a string"),
        ({"name": "\ud800"}, r"go: name is '\ud800', but must be a string"),
        ({"name": 5}, "go: name is 5, but must be a string"),
        ({"name": "n" * 201}, "but must be a string of at most 200 characters"),
        ({"x": "1"}, "go: x is '1', but must be a number"),
        ({"x": True}, "go: x is True, but must be a number"),
        ({"x": float("nan")}, "go: x is nan, but must be a number"),
        ({"how": "AWAY"}, "go: how is 'AWAY', but must be one of FAST, SLOW"),
        ({"x": 10**400}, "go: x is 1000000"),
        ({"x": None}, "go: x is None, but must be a number"),
        ({"how": ""}, "go: how is '', but must be one of FAST, SLOW"),
        ({"whom": 1}, "go: whom is 1, but must be a string"),
        ({"why": "so"}, "go has no field 'why'"),
        ({"\ud800": "so"}, r"go has no field '\ud800'"),
    ],
)
def test_invalid_command_value_is_reported(values, words):
    with pytest.raises(CommandError) as error:
        GO.check({**RIGHT, **values})
    assert words in str(error.value)


@pytest.mark.parametrize("kind", ["text", "number", "choice", "found"])
@pytest.mark.parametrize("values", [{}, {"how": ""}, {"how": None}])
def test_optional_field_may_be_empty(kind, values):
    field = CommandField("how", "How", kind, (("FAST", "fast"),), optional=True)
    assert OperatorCommand("go", "Go", "Goes.", fields=(field,)).check(values) == {
        "how": None if kind == "number" else ""
    }


def test_missing_value_is_reported():
    with pytest.raises(CommandError, match="go: x is None, but must be a number"):
        GO.check({"name": "there", "how": "FAST", "whom": ""})


def test_irreversible_commands_require_confirmation():
    assert {verb.name for verb in VERBS if verb.confirm} == {"skip_zone", "go_home", "abort"}


@pytest.mark.ros
def test_commands_fill_requests_of_their_services():
    from sar_interfaces.srv import AddZone, JudgeSurvivor

    verbs = {verb.name: verb for verb in VERBS}
    zone, judge = AddZone.Request(), JudgeSurvivor.Request()
    values = verbs["add_zone"].check({"zone": "zone_e", "x": 1.5, "y": -2, "heading": 180})
    verbs["add_zone"].fill(zone, values)
    assert (zone.zone_id, zone.pose.header.frame_id) == ("zone_e", "map")
    assert (zone.pose.pose.position.x, zone.pose.pose.position.y) == (1.5, -2.0)
    assert (round(zone.pose.pose.orientation.z, 6), round(zone.pose.pose.orientation.w, 6)) == (1.0, 0.0)
    judged = verbs["judge_survivor"].check(
        {"survivor": "survivor_2", "verdict": "SAME", "same_as": "survivor_1"}
    )
    verbs["judge_survivor"].fill(judge, judged)
    assert (judge.survivor_id, judge.verdict, judge.same_as) == (
        "survivor_2",
        JudgeSurvivor.Request.SAME,
        "survivor_1",
    )


@pytest.mark.ros
@pytest.mark.parametrize(("x", "y"), [(None, None), (1.5, -2.0)])
def test_hint_request_contains_zone_and_optional_position(x, y):
    from sar_interfaces.srv import AddHint

    verb, request = {each.name: each for each in VERBS}["add_hint"], AddHint.Request()
    verb.fill(request, verb.check({"zone": "zone_b", "x": x, "y": y, "times": 3}))
    assert (request.zone_id, request.likelihood_ratio) == ("zone_b", 3.0)
    assert math.isnan(request.point.point.x) == (x is None)
    assert request.point.header.frame_id == "map"


@pytest.mark.ros
def test_area_request_contains_known_values():
    from sar_interfaces.srv import AddArea

    verb, request = {each.name: each for each in VERBS}["add_area"], AddArea.Request()
    corners = [[0, 0], [4.5, 0], [4.5, 3]]
    verb.fill(request, verb.check({"zone": "yard", "corners": corners, "poa": 0.25, "detection_range": None}))
    assert (request.zone_id, request.outline.header.frame_id, request.poa) == ("yard", "map", 0.25)
    assert [[point.x, point.y] for point in request.outline.polygon.points] == corners
    assert math.isnan(request.detection_range)
    verb.fill(request, verb.check({"zone": "yard", "corners": [], "poa": 0.5, "detection_range": 2}))
    assert list(request.outline.polygon.points) == []


@pytest.mark.parametrize(
    "corners",
    [[[0, 0], [1, 0]], [[0, 0]] * 101, [[0, 0], [1, 0], [1]], [[0, 0], [1, 0], [1, math.inf]], "[[0, 0]", 3],
)
def test_invalid_polygon_is_rejected(corners):
    verb = {each.name: each for each in VERBS}["add_area"]
    with pytest.raises(
        CommandError, match=r"add_area: corners is .*, but must be 3 to 100 corners, each \[x, y\] in metres"
    ):
        verb.check({"zone": "yard", "corners": corners, "poa": None, "detection_range": None})
