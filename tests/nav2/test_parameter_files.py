"""Tests of the parameter files of the runs on Nav2, read as by `sar-run --check` and Nav2, without a Nav2."""

import pytest

from sar_compiler.missions.parameter_file import read_parameter_file
from tests.nav2.parameter_files import (
    NAV2_TIMEOUT_MS,
    nav2_with_its_own_time_outs,
    one_zone_in_a_wall,
    one_zone_to_sweep,
)

MISSION = "/search_and_rescue"


@pytest.mark.parametrize(
    ("write", "node", "wanted"),
    [
        (
            one_zone_to_sweep,
            MISSION,
            {"zone_order": ["zone_a"], "initial_pose.x": 0.0, "base_station.x": 0.0},
        ),
        (one_zone_in_a_wall, MISSION, {"zone_order": ["zone_a", "zone_b"], "zones.zone_b.x": 6.2}),
        (
            nav2_with_its_own_time_outs,
            "/bt_navigator",
            {"default_server_timeout": NAV2_TIMEOUT_MS, "odom_topic": "odometry/filtered"},
        ),
    ],
)
def test_generated_parameter_file_has_intended_values(write, node, wanted, tmp_path):
    given = read_parameter_file(write(tmp_path), node)
    assert {name: given[name] for name in wanted} == wanted
