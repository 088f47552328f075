"""Tests of the shipped office floor: its parameters match its world, and each area is reachable."""

from pathlib import Path

import pytest

from sar_compiler.missions.parameter_file import read_parameter_file
from sar_compiler.missions.parameter_reader import ParameterReader, RunParameters, read_run
from sar_compiler.sim.occupancy import read_map
from sar_compiler.sim.planner import Planner, plan_route
from sar_compiler.sim.world import World, find_world
from search_and_rescue.plugin import MISSION
from search_and_rescue.search import Search

PARAMS = Path("config/offices_params.yaml")


def begun() -> tuple[Search, RunParameters]:
    reader = ParameterReader(read_parameter_file(PARAMS, "/search_and_rescue"))
    search, run = MISSION.begin(reader), read_run(reader)
    reader.complain()
    return search, run


@pytest.fixture(scope="module")
def world() -> World:
    return find_world("offices")


def test_areas_and_start_match_world(world: World) -> None:
    search, run = begun()
    assert search.places() == dict(world.places)
    assert run.initial_pose == (world.start.x, world.start.y, world.start.yaw)
    assert (run.robot_radius_m, len(search.zones.areas)) == (world.robot_radius, 10)


def test_every_area_and_home_are_reachable(world: World) -> None:
    search, run = begun()
    assert world.map_path is not None
    start = (run.initial_pose[0], run.initial_pose[1])
    legs = plan_route(Planner(read_map(world.map_path), world.robot_radius), start, search.route())
    assert [leg.trouble for leg in legs] == [""] * 11
