"""What the operator can order of a search: the services of `operating` and `failsafes`, in words."""

import math
from collections.abc import Mapping
from typing import Any

from sar_compiler.missions.search_and_rescue.zone_manager import MAP_FRAME
from sar_compiler.missions.verbs import Verb, VerbField


def _add_zone(request: Any, values: Mapping[str, Any]) -> None:
    request.zone_id = values["zone"]
    request.pose.header.frame_id = MAP_FRAME
    place, turn = request.pose.pose.position, request.pose.pose.orientation
    place.x, place.y = values["x"], values["y"]
    half = math.radians(values["heading"]) / 2.0
    turn.z, turn.w = math.sin(half), math.cos(half)


def _judge(request: Any, values: Mapping[str, Any]) -> None:
    request.survivor_id, request.same_as = values["survivor"], values["same_as"]
    request.verdict = getattr(type(request), values["verdict"])


VERBS = (
    Verb("pause", "Pause", "The robot stops where it is, and its goal is cancelled."),
    Verb("resume", "Resume", "The mission goes on."),
    Verb(
        "skip_zone",
        "Skip zone",
        "The current zone is given up.",
        confirm="The current zone will not be searched. Whoever is there is not looked for.",
    ),
    Verb(
        "add_zone",
        "Add zone",
        "A further zone, after all others.",
        "sar_interfaces/srv/AddZone",
        (
            VerbField("zone", "Name"),
            VerbField("x", "x, metres", "number"),
            VerbField("y", "y, metres", "number"),
            VerbField("heading", "heading, degrees counterclockwise from x", "number"),
        ),
        fill=_add_zone,
    ),
    Verb(
        "judge_survivor",
        "Judge a find",
        "Judge whether a find is a survivor.",
        "sar_interfaces/srv/JudgeSurvivor",
        (
            VerbField("survivor", "Find", "found"),
            VerbField(
                "verdict",
                "It is",
                "choice",
                (("CONFIRMED", "a survivor"), ("REJECTED", "nobody"), ("SAME", "the same one as another")),
            ),
            VerbField("same_as", "The same as", "found", optional=True),
        ),
        fill=_judge,
    ),
    Verb(
        "go_home",
        "Go home",
        "The robot comes back to the base station.",
        confirm="The robot comes home, and the zones that are left are not searched.",
    ),
    Verb(
        "abort",
        "Abort",
        "The mission ends where the robot stands.",
        confirm="The mission ends here and now, and the robot stays where it is.",
    ),
)
"""The verbs, in the order of their buttons."""
