"""Tests of the whole mission over DDS, with simulator, servers and mission in separate processes."""

import math

import pytest

from tests.processes import in_order

SUCCEEDED = 4

ZONES = {"zone_a": (-3.0, 3.0), "zone_b": (3.5, 3.0), "zone_c": (4.0, -3.0), "zone_d": (-3.5, -3.0)}
GOALS = [
    "Goal accepted: (-3.00, 3.00, yaw 0.00).",
    "Goal accepted: (3.50, 3.00, yaw 1.57).",
    "Goal accepted: (4.00, -3.00, yaw 3.14).",
    "Goal accepted: (-3.50, -3.00, yaw -1.57).",
    "Goal accepted: (0.00, 0.00, yaw 0.00).",
]

MISSION_LOG = [
    "Loaded 4 search zones from parameters.",
    "Base station at (0.00, 0.00, yaw=0.00).",
    "Nav2 is active.",
    "--- Zone 1/4: zone_a (-3.00, 3.00) ---",
    "Navigating to zone_a...",
    "Reached zone_a.",
    "Calling detect_survivor for zone_a...",
    "Survivor detected at zone_a!",
    "Broadcasting TF frame: survivor_1 at (-2.50, 3.20) in map frame.",
    "Reporting survivor_1 to base...",
    "Base acknowledged survivor_1.",
    "--- Zone 2/4: zone_b (3.50, 3.00) ---",
    "Navigating to zone_b...",
    "Reached zone_b.",
    "Calling detect_survivor for zone_b...",
    "No survivor found at zone_b.",
    "--- Zone 3/4: zone_c (4.00, -3.00) ---",
    "Navigating to zone_c...",
    "Reached zone_c.",
    "Calling detect_survivor for zone_c...",
    "Survivor detected at zone_c!",
    "Broadcasting TF frame: survivor_2 at (4.10, -2.50) in map frame.",
    "Reporting survivor_2 to base...",
    "Base acknowledged survivor_2.",
    "--- Zone 4/4: zone_d (-3.50, -3.00) ---",
    "Navigating to zone_d...",
    "Reached zone_d.",
    "Calling detect_survivor for zone_d...",
    "No survivor found at zone_d.",
    "All zones visited. Returning to base.",
    "Navigating to base station...",
    "Reached base station.",
    "Mission complete.",
]
DETECTION_LOG = [
    "DetectSurvivor service ready.",
    "Detection request for zone_a: FOUND at (-2.50, 3.20)",
    "Detection request for zone_b: NOT FOUND",
    "Detection request for zone_c: FOUND at (4.10, -2.50)",
    "Detection request for zone_d: NOT FOUND",
]
REPORT_LOG = [
    "ReportSurvivor service ready.",
    "Report received: survivor_1 at (-2.50, 3.20). Acknowledged.",
    "The point of survivor_1 is in frame 'map'.",
    "Report received: survivor_2 at (4.10, -2.50). Acknowledged.",
    "The point of survivor_2 is in frame 'map'.",
]


def check_contract(start, witness, speed, namespace):
    """Run the mission and check its contract; the robot may have a namespace."""
    moved = (
        ["-r", f"__ns:={namespace}", "-r", "/tf:=tf", "-r", "/tf_static:=tf_static"]
        if namespace != "/"
        else []
    )
    watching = witness(namespace)
    sim = start("sar-sim", "run", "--speed", speed, "--ros-args", *moved, "--log-level", "debug")
    watching.wait_until_seen()
    detection = start("sar-detect-survivor-server", "--ros-args", *moved)
    reports = start("sar-report-survivor-server", "--ros-args", *moved)
    mission = start(
        "sar-run", "--params", "config/mission_params.yaml", "--ros-args", *moved, "-p", "use_sim_time:=true"
    )
    mission.wait_for("Mission complete.")

    # A node that joins after the mission still receives both frames, and no other frame.
    topic = "tf_static" if namespace != "/" else "/tf_static"
    frames = watching.frames(["survivor_1", "survivor_2"], topic)
    assert frames == {"survivor_1": ("map", -2.5, 3.2), "survivor_2": ("map", 4.1, -2.5)}

    # A complete mission idles until it is stopped, which is no failure.
    status = mission.stop()
    assert status == 0, mission.output

    nominal = [line for line in mission.log if line in set(MISSION_LOG)]
    assert nominal == MISSION_LOG, mission.output
    assert detection.log == DETECTION_LOG
    assert [line for line in reports.log if not line.startswith("[")] == REPORT_LOG
    assert [line for line in sim.log if line.startswith("Goal accepted")] == GOALS
    watching.wait_for_goals(lambda goals: goals == [SUCCEEDED] * 5)

    for wall_time, _, text in detection.stamped_log()[1:]:
        zone = next(zone for zone in ZONES if zone in text)
        assert math.dist(watching.place_at(wall_time), ZONES[zone]) < 0.25, text
    assert math.dist(watching.place(), (0.0, 0.0)) < 0.25


@pytest.mark.ros
@pytest.mark.parametrize("namespace", ["/", pytest.param("/robot1", marks=pytest.mark.costly)])
def test_mission_fulfils_contract(start, witness, namespace):
    # Simulated time does not wait for a mission in another process, whose responses may take at most 5 simulated seconds.
    check_contract(start, witness, speed=5, namespace=namespace)


@pytest.mark.ros
@pytest.mark.slow
def test_mission_fulfils_contract_in_real_time(start, witness):
    check_contract(start, witness, speed=1, namespace="/")


@pytest.mark.ros
def test_one_command_runs_whole_mission_and_prints_summary(start):
    run = start("sar-run", "--sim", "--speed", 20)
    assert run.end() == 0, run.output
    assert (
        in_order(["DetectSurvivor service ready.", "ReportSurvivor service ready.", *MISSION_LOG], run.log)
        is None
    )
    assert run.output.splitlines()[-7:-2] == [
        "Summary: the mission is complete.",
        "  zones visited:   4 of 4 (zone_a, zone_b, zone_c, zone_d)",
        "  survivors found: survivor_1 in zone_a at (-2.50, 3.20), acknowledged",
        "                   survivor_2 in zone_c at (4.10, -2.50), acknowledged",
        "  back at base:    yes",
    ]
    *_, duration, head = run.output.splitlines()
    assert duration.startswith("  duration:        ")
    assert head.startswith("Journal hash (verify with sar-journal check --head): ")


@pytest.mark.costly
@pytest.mark.ros
def test_mission_runs_with_stand_in_of_py_trees_ros(start):
    run = start(
        "sar-run", "--sim", "--speed", 20, "--engine", "py_trees_ros", env={"PYTHONPATH": "tests/stand_ins"}
    )
    assert run.end() == 0, run.output
    assert in_order(MISSION_LOG, run.log) is None
