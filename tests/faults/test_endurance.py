"""Tests that many missions in one process, and many zones in one mission, do not leak resources."""

import json
from itertools import pairwise

import pytest

from tests.faults.endurance import holdings

pytestmark = pytest.mark.ros

# The allowed growth per mission, which creates thousands of objects.
OBJECTS_PER_MISSION, MEMORY_PER_MISSION_KB = 20, 30.0
# Some data of a zone is kept, such as its name.
MEMORY_PER_ZONE_KB = 5.0
# The allowed growth of objects from one mission to the next, after the first runs, when all modules are imported.
OBJECTS_OF_A_RUN, SETTLED_RUNS = 500, 2
# From these numbers on, freed memory is reused.
SETTLED_MISSIONS, SETTLED_ZONES = 50, 400


def start_missions(start, missions, tree, place, zones, *more):
    """Start missions in one process."""
    parameters = [
        word
        for name, value in {"set_initial_pose": "false", **zones}.items()
        for word in ("-p", f"{name}:={value}")
    ]
    return start(
        "python", "-m", "tests.faults.endurance", missions, tree, "--until", "complete", "--journal", place, *more,
        "--ros-args", *parameters,
    )  # fmt: skip


def require_no_growth(first, last):
    """Assert that there are no more threads and file descriptors than before."""
    assert last["threads"] <= first["threads"]
    assert last["descriptors"] <= first["descriptors"]


@pytest.mark.costly
@pytest.mark.parametrize("missions", [8, pytest.param(500, marks=pytest.mark.slow)], ids=["short", "long"])
def test_consecutive_missions_leak_no_objects_threads_or_memory(serve, start, tmp_path, missions):
    serve("navigation", goals=[{"drive": 0.0}])
    serve("survivors", found={"zone_a": (1.0, 1.0)})
    zones = {"zone_order": "[zone_a, zone_b]"}
    process = start_missions(start, missions, "search_and_rescue", tmp_path / "mission.journal", zones)
    told = []
    for number in range(1, missions + 1):
        name = f"mission {number}: "
        process.wait_for(name)
        line = next(line for line in process.output.splitlines() if line.startswith(name))
        told.append(json.loads(line.removeprefix(name)))
    assert {each["status"] for each in told} == {0}
    first, last = told[missions // 3], told[-1]
    require_no_growth(first, last)
    # A leaked run would be thousands of objects.
    kept = {
        number: now["came"]
        for number, (before, now) in enumerate(pairwise(told), 2)
        if number > SETTLED_RUNS and now["objects"] - before["objects"] > OBJECTS_OF_A_RUN
    }
    assert kept == {}
    assert last["objects"] - first["objects"] <= OBJECTS_PER_MISSION * (missions - missions // 3)
    if missions > SETTLED_MISSIONS:
        grown = last["memory"] - told[SETTLED_MISSIONS]["memory"]
        assert grown <= MEMORY_PER_MISSION_KB * (missions - SETTLED_MISSIONS)


@pytest.mark.costly
@pytest.mark.parametrize("view", [(), ("--view", "web", "--web-port", "0")], ids=["no page", "page"])
@pytest.mark.parametrize("zones", [60, pytest.param(2000, marks=pytest.mark.slow)], ids=["short", "long"])
def test_mission_of_many_zones_leaks_no_threads_or_memory(serve, start, tmp_path, zones, view):
    names = [f"zone_{number}" for number in range(1, zones + 1)]
    serve("navigation", goals=[{"drive": 0.0}])
    serve("survivors", found={name: (0.0, number) for number, name in enumerate(names[::10])})
    params = tmp_path / "params.yaml"
    places = "".join(f"        {name}: {{x: 1.0, y: 2.0, yaw: 0.0}}\n" for name in names)
    params.write_text(
        f"/**:\n  ros__parameters:\n    zone_order: [{', '.join(names)}]\n    zones:\n{places}"
        "    base_station: {x: 0.0, y: 0.0, yaw: 0.0}\n",
        encoding="utf-8",
    )
    tree = "search_and_rescue_resilient"
    process = start_missions(start, 1, tree, tmp_path / "mission.journal", {}, "--params", params, *view)
    told = {}
    for number in range(zones // 10, zones + 1, zones // 10):
        process.wait_for(f"Reached zone_{number}.")
        told[number] = holdings(process.pid)
    require_no_growth(told[zones // 5], told[zones])
    if zones > SETTLED_ZONES:
        grown = told[zones]["memory"] - told[SETTLED_ZONES]["memory"]
        assert grown <= MEMORY_PER_ZONE_KB * (zones - SETTLED_ZONES)
    process.wait_for('mission 1: {"status": 0')
