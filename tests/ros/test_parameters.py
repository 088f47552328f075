"""Tests of reading a mission's parameters and of checking parameter files, without ROS."""

import contextlib
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.missions.parameter_file import ParameterFileError, check_parameter_file
from sar_compiler.missions.parameter_reader import (
    MOST_PLACES,
    RUN_PARAMETER_NAMES,
    ParameterError,
    ParameterReader,
    RunParameters,
    lookalikes,
    read_run,
)
from sar_compiler.opener import UnreadableFileError
from sar_compiler.resources import shipped_root
from search_and_rescue.plugin import MISSION
from search_and_rescue.zone_manager import read_survivors

MISSION_NAMES = (*RUN_PARAMETER_NAMES, *MISSION.parameter_names)
HEAD = "/**:\n  ros__parameters:\n"


def mission(**changes: object) -> dict[str, object]:
    """Return parameters of two zones; `__` stands for a dot, None removes a parameter."""
    parameters: dict[str, object] = {"zone_order": ["zone_a", "zone_b"]}
    for zone in ("zone_a", "zone_b"):
        parameters |= {f"zones.{zone}.x": 1.5, f"zones.{zone}.y": -2.0, f"zones.{zone}.yaw": 0.5}
    parameters |= {key.replace("__", "."): value for key, value in changes.items()}
    return {key: value for key, value in parameters.items() if value is not None}


@dataclass
class Read:
    """The parameters of a mission and its run."""

    zones: list[dict[str, Any]]
    base_station: dict[str, float]
    run: RunParameters
    notes: list[str]


def read_mission(parameters: Mapping[str, object]) -> Read:
    """Read parameters as a run of the mission does."""
    reader = ParameterReader(parameters)
    zones, base_station = reader.places("zone"), reader.pose("base_station")
    run = read_run(reader)
    reader.complain()
    return Read(zones, base_station, run, reader.notes)


def read_run_of(parameters: Mapping[str, object]) -> RunParameters:
    reader = ParameterReader(parameters)
    run = read_run(reader)
    reader.complain()
    return run


def errors_of(parameters: Mapping[str, object]) -> dict[str, str]:
    with pytest.raises(ParameterError) as caught:
        read_mission(parameters)
    assert all(problem.key in str(caught.value) for problem in caught.value.problems)
    return {problem.key: problem.text for problem in caught.value.problems}


class TestMissionParameters:
    def test_zones_are_in_order_of_visit(self) -> None:
        read = read_mission(mission(zone_order=["zone_b", "zone_a"]))
        assert read.zones == [
            {"id": "zone_b", "x": 1.5, "y": -2.0, "yaw": 0.5},
            {"id": "zone_a", "x": 1.5, "y": -2.0, "yaw": 0.5},
        ]

    def test_optional_parameters_have_defaults(self) -> None:
        read = read_mission(mission())
        assert read.base_station == {"x": 0.0, "y": 0.0, "yaw": 0.0}
        assert read.run.initial_pose == (0.0, 0.0, 0.0)
        assert (read.run.tick_rate_hz, read.run.set_initial_pose, read.notes) == (2.0, True, [])

    def test_given_values_are_used(self) -> None:
        given = mission(base_station__x=1, base_station__yaw=-0.5, tick_rate_hz=10, set_initial_pose=False)
        read = read_mission(given)
        assert read.base_station == {"x": 1.0, "y": 0.0, "yaw": -0.5}
        assert (read.run.tick_rate_hz, read.run.set_initial_pose) == (10.0, False)

    def test_initial_pose_is_independent_of_base_station(self) -> None:
        read = read_mission(mission(initial_pose__x=-2, initial_pose__yaw=1.57, base_station__y=0.5))
        assert read.run.initial_pose == (-2.0, 0.0, 1.57)
        assert read.base_station == {"x": 0.0, "y": 0.5, "yaw": 0.0}

    def test_integers_are_read_as_floats(self) -> None:
        x = read_mission(mission(zones__zone_a__x=3)).zones[0]["x"]
        assert (x, type(x)) == (3.0, float)

    def test_unrelated_parameters_are_ignored(self) -> None:
        assert not read_mission(mission(use_sim_time=True, goal_x=2.0, zone_count=3)).notes

    def test_ids_may_have_dots(self) -> None:
        pose = {"zones.floor.1.x": 1.0, "zones.floor.1.y": 2.0, "zones.floor.1.yaw": 3.0}
        assert read_mission({"zone_order": ["floor.1"], **pose}).zones[0]["id"] == "floor.1"

    def test_unvisited_zone_is_noted(self) -> None:
        [note] = read_mission(mission(zone_order=["zone_a"])).notes
        assert "zone_b" in note
        assert "never visited" in note

    @given(
        st.lists(
            st.tuples(
                st.text(st.characters(min_codepoint=97, max_codepoint=122), min_size=1, max_size=6),
                st.floats(-1e6, 1e6),
                st.integers(-(10**6), 10**6),
            ),
            min_size=1,
            unique_by=lambda zone: zone[0],
        )
    )
    def test_every_mission_with_complete_poses_is_read(self, zones: list[tuple[str, float, int]]) -> None:
        parameters: dict[str, object] = {"zone_order": [name for name, _, _ in zones]}
        for name, x, y in zones:
            parameters |= {f"zones.{name}.x": x, f"zones.{name}.y": y, f"zones.{name}.yaw": 0}
        read = read_mission(parameters)
        assert [(zone["id"], zone["x"], zone["y"]) for zone in read.zones] == [
            (name, x, float(y)) for name, x, y in zones
        ]

    @given(
        st.dictionaries(
            st.sampled_from(
                [
                    *("zone_order", "zones", "zones.a", "zones.a.x", "zones.a.y", "zones.a.yaw", "zones.a.z"),
                    *("base_station", "base_station.x", "base_station.q", "tick_rate_hz", "set_initial_pose"),
                    *("initial_pose", "initial_pose.x", "initial_pose.q"),
                ]
            ),
            st.one_of(
                st.none(),
                st.booleans(),
                st.integers(),
                st.floats(),
                st.text(max_size=3),
                st.lists(st.one_of(st.text(max_size=2), st.integers(), st.just("a")), max_size=3),
            ),
        )
    )
    def test_any_parameters_are_read_or_rejected(self, parameters: dict[str, object]) -> None:
        read: Read | None = None
        with contextlib.suppress(ParameterError):
            read = read_mission(parameters)
        if read is not None:
            assert read.zones
            assert all(math.isfinite(zone[name]) for zone in read.zones for name in ("x", "y", "yaw"))


class TestOtherLocationNames:
    def test_locations_are_read_from_parameters_of_their_name(self) -> None:
        pose = {"points.gate.x": 1, "points.gate.y": 2.0, "points.gate.yaw": 0.5}
        reader = ParameterReader({"point_order": ["gate"], **pose, "points.yard.x": 1.0})
        assert reader.places("point") == [{"id": "gate", "x": 1.0, "y": 2.0, "yaw": 0.5}]
        assert reader.notes == ["points.yard is not in point_order, so it is never visited"]

    def test_errors_use_name_of_locations(self) -> None:
        reader = ParameterReader({"point_ordr": ["gate"]}, elsewhere="look there")
        reader.places("point")
        assert [str(problem) for problem in reader.problems] == [
            (
                "point_order: is missing (did you mean 'point_ordr'?): list the points to visit, for "
                'example point_order: ["point_a", "point_b"] (look there)'
            )
        ]


class TestInvalidParameters:
    def test_missing_order_is_explained(self) -> None:
        assert "is missing: list the zones to visit" in errors_of(mission(zone_order=None))["zone_order"]

    def test_misspelt_order_is_pointed_out(self) -> None:
        assert "'zone_oder'" in errors_of(mission(zone_order=None, zone_oder=["zone_a"]))["zone_order"]

    def test_empty_order_is_rejected(self) -> None:
        assert "is empty" in errors_of(mission(zone_order=[]))["zone_order"]

    @pytest.mark.parametrize("value", ["zone_a", 3, True, 1.5])
    def test_order_must_be_list(self, value: object) -> None:
        assert "must be a list of zone ids" in errors_of(mission(zone_order=value))["zone_order"]

    @pytest.mark.parametrize("value", [[1, 2], [True], [""], [1.5]])
    def test_order_must_contain_strings(self, value: object) -> None:
        assert "must be a list of zone ids (strings)" in errors_of(mission(zone_order=value))["zone_order"]

    def test_zone_named_twice_is_rejected(self) -> None:
        found = errors_of(mission(zone_order=["zone_a", "zone_b", "zone_a"]))
        assert found == {"zone_order": "names 'zone_a' more than once"}

    def test_too_many_zones_are_rejected(self) -> None:
        order = [f"zone_{number}" for number in range(MOST_PLACES + 1)]
        found = errors_of(mission(zone_order=order))
        assert found == {
            "zone_order": "names 1,001 zones, but at most 1,000 are allowed: move some zones to another mission"
        }

    def test_zone_without_pose_is_reported_with_nearest_name(self) -> None:
        [text] = errors_of(mission(zone_order=["zone_a", "zone_B"])).values()
        assert "names 'zone_B', which has no pose: add zones.zone_B.x" in text
        assert "did you mean 'zone_b'?" in text

    @pytest.mark.parametrize("name", ["x", "y", "yaw"])
    def test_missing_coordinate_is_reported(self, name: str) -> None:
        found = errors_of({k: v for k, v in mission().items() if k != f"zones.zone_b.{name}"})
        assert found == {f"zones.zone_b.{name}": "is missing: write a number"}

    def test_missing_number_without_default_is_reported(self) -> None:
        reader = ParameterReader({"height": 2})
        assert (reader.number("height"), reader.number("depth", 1.5), reader.number("width")) == (
            2.0,
            1.5,
            0.0,
        )
        assert [str(each) for each in reader.problems] == ["width: is missing: write a number"]

    @pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
    def test_number_must_be_finite(self, value: float) -> None:
        assert "finite" in errors_of(mission(zones__zone_a__x=value))["zones.zone_a.x"]

    @pytest.mark.parametrize("value", [True, "far", [1.0], None])
    def test_coordinate_must_be_number(self, value: object) -> None:
        parameters = mission() | {"zones.zone_a.x": value}
        assert "must be a number" in errors_of(parameters)["zones.zone_a.x"]

    def test_quoted_number_is_rejected(self) -> None:
        text = errors_of(mission(base_station__x="1.5"))["base_station.x"]
        assert text == "must be a number, but is the string '1.5' (write it without quotes)"

    @pytest.mark.parametrize("value", [math.inf, "0.5", True])
    def test_invalid_initial_pose_is_rejected(self, value: object) -> None:
        assert list(errors_of(mission(initial_pose__y=value))) == ["initial_pose.y"]

    @pytest.mark.parametrize("value", [0, -1.0, math.nan, 1e9, 1e-12, "2", False])
    def test_invalid_tick_rate_is_rejected(self, value: object) -> None:
        assert list(errors_of(mission(tick_rate_hz=value))) == ["tick_rate_hz"]

    def test_unknown_name_in_pose_is_reported(self) -> None:
        assert "did you mean 'yaw'?" in errors_of(mission(zones__zone_a__yw=1.0))["zones.zone_a.yw"]
        assert "did you mean 'x'?" in errors_of(mission(base_station__X=1.0))["base_station.X"]
        assert "did you mean 'yaw'?" in errors_of(mission(initial_pose__Yaw=1.0))["initial_pose.Yaw"]
        assert (
            "expected one of x, y, yaw"
            in errors_of(mission(zones__zone_a__height=1.0))["zones.zone_a.height"]
        )

    @pytest.mark.parametrize("key", ["zones", "zones.zone_a", "base_station", "initial_pose"])
    def test_value_in_place_of_pose_is_rejected(self, key: str) -> None:
        assert key in errors_of(mission() | {key: 3.0})

    @pytest.mark.parametrize("value", ["yes", 1, None])
    def test_boolean_must_be_true_or_false(self, value: object) -> None:
        assert "true or false" in errors_of(mission() | {"set_initial_pose": value})["set_initial_pose"]

    def test_all_errors_are_reported_at_once(self) -> None:
        parameters = mission(
            zones__zone_a__x="far", zones__zone_b__yaw=None, tick_rate_hz=0, zone_order=["zone_a", "q"]
        )
        assert list(errors_of(parameters)) == ["zone_order", "zones.zone_a.x", "tick_rate_hz"]


class TestRunParameters:
    def test_run_parameters_have_defaults(self) -> None:
        run = read_run_of({"use_sim_time": False})
        assert (run.tick_rate_hz, run.set_initial_pose) == (2.0, True)
        assert (run.startup_timeout_sec, run.time_limit_sec) == (60.0, None)

    def test_given_values_are_used(self) -> None:
        run = read_run_of(
            {"tick_rate_hz": 5, "startup_timeout_sec": 3, "time_limit_sec": 600.0, "initial_pose.x": 1}
        )
        assert run.initial_pose == (1.0, 0.0, 0.0)
        assert (run.tick_rate_hz, run.startup_timeout_sec, run.time_limit_sec) == (5.0, 3.0, 600.0)

    @pytest.mark.parametrize("key", ["tick_rate_hz", "startup_timeout_sec", "time_limit_sec"])
    @pytest.mark.parametrize("value", [0, -1.0, math.inf, "2", True])
    def test_invalid_duration_or_rate_is_rejected(self, key: str, value: object) -> None:
        with pytest.raises(ParameterError) as caught:
            read_run_of({key: value})
        assert [problem.key for problem in caught.value.problems] == [key]


class TestUnusedNames:
    @pytest.mark.parametrize(
        ("given", "meant"),
        [
            ("tick_rate", "tick_rate_hz"),
            ("Tick_Rate_Hz", "tick_rate_hz"),
            ("startup_timeout", "startup_timeout_sec"),
            ("time_limit", "time_limit_sec"),
            ("zone_oder", "zone_order"),
            ("use_simtime", "use_sim_time"),
            ("goalx", "goal_x"),
            ("wait.secs", "wait.sec"),
        ],
    )
    def test_misspelt_name_is_noted_with_suggestion(self, given: str, meant: str) -> None:
        notes = lookalikes([given], (*MISSION_NAMES, "goal_x", "wait.sec"))
        assert notes == [f"parameter '{given}' is not used: did you mean '{meant}'?"]

    def test_misspelt_name_is_noted_even_if_correct_name_is_given(self) -> None:
        assert len(lookalikes(["goal_x", "goalx"], ["goal_x"])) == 1

    def test_misspelt_group_is_noted_once(self) -> None:
        given = ["survivor.kitchen.x", "survivor.kitchen.y", "survivor.attic.x"]
        assert lookalikes(given, MISSION_NAMES) == [
            "parameter 'survivor' is not used: did you mean 'survivors'?"
        ]

    def test_used_names_are_not_noted(self) -> None:
        given = ["survivors.attic.x", "zones.attic.x", "initial_pose.yaw", "use_sim_time", "goal_x"]
        assert lookalikes(given, (*MISSION_NAMES, "goal_x")) == []

    def test_dissimilar_names_are_not_noted(self) -> None:
        assert (
            lookalikes(["robot_description", "zone_count", "goal.height"], ["goal.x", *MISSION_NAMES]) == []
        )

    def test_every_run_parameter_is_known(self) -> None:
        assert lookalikes([field.name for field in fields(RunParameters)], MISSION_NAMES) == []
        assert {field.name for field in fields(RunParameters)} <= set(MISSION_NAMES)


class TestSurvivors:
    DEFAULT = {"zone_a": (1.0, 2.0)}  # noqa: RUF012

    def test_default_is_used_if_no_survivors_are_given(self) -> None:
        assert read_survivors({"use_sim_time": False}, self.DEFAULT) == self.DEFAULT

    def test_table_replaces_default(self) -> None:
        given = {"survivors.zone_b.x": 3, "survivors.zone_b.y": -1.5}
        assert read_survivors(given, self.DEFAULT) == {"zone_b": (3.0, -1.5)}

    def test_every_error_names_its_key(self) -> None:
        given = {"survivors.zone_b.x": "3", "survivors.zone_c.z": 1.0, "survivors": 2}
        with pytest.raises(ParameterError) as caught:
            read_survivors(given, self.DEFAULT)
        keys = {problem.key for problem in caught.value.problems}
        assert keys == {
            *("survivors.zone_b.x", "survivors.zone_b.y", "survivors.zone_c.z"),
            *("survivors.zone_c.x", "survivors.zone_c.y", "survivors"),
        }


def file_error(tmp_path: Path, text: str | bytes) -> ParameterFileError:
    path = tmp_path / "params.yaml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    with pytest.raises(ParameterFileError) as caught:
        check_parameter_file(path)
    error = caught.value
    assert error.file == path
    assert str(error).startswith(f"{path}:{error.line}:{error.column}: " if error.line else f"{path}: ")
    return error


def below(text: str) -> str:
    """Insert lines below `ros__parameters`, beginning in line 3."""
    return HEAD + "".join(f"    {line}\n" for line in text.splitlines())


class TestParameterFiles:
    @pytest.mark.parametrize(
        "text",
        [
            "x: 1",
            "x: {y: {z: 1.0}}",
            "x: [1.0, 2.5]\nzone_order: [a, 'b', \"c\"]",
            "x: [on, yes, false]",
            "x: [1, 0x10, -3]",
            "x: [1e3, 2.0, .inf, .nan]",
            "x: [!!str 1, a]",
            "x: !!str null",
            "x: ''\ny: 'null'",
            "zones.a.x: 1.0\nzones.a.y: 2.0",
            "x: 0\ny: 007\nz: 2020-01-01",
            "x: 12:30",
        ],
    )
    def test_file_that_ros_reads_passes(self, tmp_path: Path, text: str) -> None:
        path = tmp_path / "params.yaml"
        path.write_text(below(text))
        check_parameter_file(path)

    def test_shipped_file_passes_and_has_contract_values(self) -> None:
        path = shipped_root() / "config" / "mission_params.yaml"
        check_parameter_file(path)
        values = yaml.safe_load(path.read_text())["/**"]["ros__parameters"]
        assert values == {
            "zone_order": ["zone_a", "zone_b", "zone_c", "zone_d"],
            "zones": {
                "zone_a": {"x": -3.0, "y": 3.0, "yaw": 0.0},
                "zone_b": {"x": 3.5, "y": 3.0, "yaw": 1.57},
                "zone_c": {"x": 4.0, "y": -3.0, "yaw": 3.14},
                "zone_d": {"x": -3.5, "y": -3.0, "yaw": -1.57},
            },
            "base_station": {"x": 0.0, "y": 0.0, "yaw": 0.0},
            "tick_rate_hz": 2.0,
            "initial_pose": {"x": 0.0, "y": 0.0, "yaw": 0.0},
            "set_initial_pose": True,
        }

    def test_nodes_may_be_nested_in_namespaces(self, tmp_path: Path) -> None:
        path = tmp_path / "params.yaml"
        path.write_text("/group3:\n  a:\n    ros__parameters: {x: 1}\n  b:\n    ros__parameters: {x: 2}\n")
        check_parameter_file(path)

    @pytest.mark.parametrize(
        ("text", "line", "column", "part"),
        [
            ("zone_order: []", 3, 17, "'zone_order' is an empty list"),
            ("x: {}", 3, 8, "'x' is empty"),
            ("x: [1, 2.5]", 3, 12, "mixes an integer with a number"),
            ("x: [1.0, 2]", 3, 14, "(write 1.0 for 1)"),
            ("x: ['1', 2]", 3, 14, "mixes text with an integer"),
            ("x: [true, 1]", 3, 15, "mixes a Boolean with"),
            ("x: [a, {b: 1}]", 3, 12, "list of mappings"),
            ("x: [[1], [2]]", 3, 9, "list of lists"),
            ("x: [a, ~]", 3, 12, "because it has no empty values"),
            ("y: 1\nx:", 4, 7, "'x' has no value"),
            ("x: null", 3, 8, "would read as a string"),
            ("zones:\n  a: {x: ~}", 4, 14, "'zones.a.x' is ~"),
            ("x: 1\nx: 2", 4, 5, "'x' is given twice (first in line 3)"),
            ("a.b: 1\na:\n  b: 2", 5, 7, "'a.b' is given twice (first in line 3)"),
            ("z: {x: 1}\nz: {y: 1}", 4, 5, "'z' is given twice"),
            ("x: &a 1\ny: *a", 4, 8, "ROS does not support aliases: write the value of '*a' in full"),
            ("x: !degrees 90", 3, 8, "has the tag !degrees"),
            ("x: !!int '3'", 3, 8, "which ROS ignores"),
            ("x: 1_000", 3, 8, "'x' is 1_000, which ROS reads as a string"),
            ("x: 0o10", 3, 8, "'x' is 0o10, which ROS reads as a string"),
            ("x: 1e999", 3, 8, "'x' is 1e999, which ROS reads as a string"),
            ("x: 010", 3, 8, "octal number 8"),
            ("? [a]\n: 1", 3, 7, "a key must be a name"),
            ("\tx: 1", 3, 5, "tab"),
            ("x: [1, 2", 4, 1, "not YAML"),
            ("x: 1\n y: 2", 4, 7, "not YAML"),
            ("x: \x07", 3, 8, "delete the character"),
        ],
    )
    def test_value_that_ros_rejects_or_misreads_has_location(
        self, tmp_path: Path, text: str, line: int, column: int, part: str
    ) -> None:
        error = file_error(tmp_path, below(text))
        assert part in str(error)
        assert (error.line, error.column) == (line, column)

    @pytest.mark.parametrize(
        ("text", "part"),
        [
            ("", "the file is empty"),
            ("# nothing\n", "the file is empty"),
            ("hello\n", "must be a mapping"),
            ("- a\n", "must be a mapping"),
            ("{}\n", "has no ros__parameters"),
            ("zone_order: [a]\n", "'zone_order' is outside of ros__parameters"),
            ("/**:\n  zone_order: [a]\n", "'zone_order' is outside of ros__parameters"),
            ("/**: {}\n", "'/**' has no ros__parameters below it"),
            ("/my robot:\n  ros__parameters: {x: 1}\n", "'/my robot' is not a valid node name or namespace"),
            ("/a//b:\n  ros__parameters: {x: 1}\n", "'/a//b' is not a valid node name or namespace"),
            ("/**:\n  ros__parameters: {'': 1}\n", "a name is missing before this ':'"),
            ("/**:\n  ros__parameters: {x: a:b}\n", "'a:b' needs quotes within [] and {}"),
            ("/**:\n  ros__parameters: {x: [why?]}\n", "'why?' needs quotes within [] and {}"),
            ("ros__parameters:\n  x: 1\n", "no node name"),
            ("/**:\n  ros__parameters:\n", "must contain parameters"),
            ("/**:\n  ros__parameters: [1]\n", "must contain parameters"),
            (HEAD + "    x: 1\n---\n" + HEAD + "    x: 2\n", "second document"),
            ("%YAML 1.2\n---\n" + HEAD + "    x: 1\n", "YAML 1.1 only"),
            ("/**: " + "{a: " * 2000 + "}" * 2000, "nested too deeply"),
            (HEAD.encode() + b"    x: \xff\n", "not UTF-8"),
        ],
    )
    def test_malformed_parameter_file_is_rejected(self, tmp_path: Path, text: str | bytes, part: str) -> None:
        assert part in str(file_error(tmp_path, text))

    def test_missing_file_is_reported(self, tmp_path: Path) -> None:
        with pytest.raises(UnreadableFileError, match=r"none\.yaml: No such file"):
            check_parameter_file(tmp_path / "none.yaml")

    def test_named_pipe_is_rejected_without_waiting_for_writer(self, tmp_path: Path) -> None:
        os.mkfifo(tmp_path / "params.yaml")
        with pytest.raises(UnreadableFileError, match="it is a pipe"):
            check_parameter_file(tmp_path / "params.yaml")

    def test_byte_order_mark_and_windows_line_ends_pass(self, tmp_path: Path) -> None:
        path = tmp_path / "params.yaml"
        path.write_bytes(b"\xef\xbb\xbf" + below("x: 1").replace("\n", "\r\n").encode())
        check_parameter_file(path)

    def test_all_errors_of_file_are_reported_in_order(self, tmp_path: Path) -> None:
        error = file_error(tmp_path, below("zone_order: []\nx: ~\ny: [1, 2.0]"))
        assert [problem.line for problem in error.problems] == [3, 4, 5]

    @given(st.text(max_size=60))
    def test_any_text_passes_or_is_rejected_with_message(self, text: str) -> None:
        from sar_compiler.missions import parameter_file

        for problem in parameter_file._Walk(HEAD + "    x: " + text).problems:
            assert problem.text
            assert problem.line >= 1


def test_georeference_is_read_and_optional():
    given = {"georeference.lat": 48.2, "georeference.lon": 16, "georeference.heading": 90.0}
    assert read_run_of(given).georeference == (48.2, 16.0, 90.0)
    assert read_run_of({}).georeference is None


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"georeference": 3}, "georeference: must contain lat, lon and heading, but is the number 3"),
        (
            {"georeference.lat": 1.0, "georeference.lon": 2.0},
            "georeference.heading: is missing: write a number",
        ),
        (
            {"georeference.lat": 91.0, "georeference.lon": 2.0, "georeference.heading": 0.0},
            "georeference.lat: must be degrees between -90 and 90, not 91",
        ),
        (
            {
                "georeference.lat": 1.0,
                "georeference.lon": 2.0,
                "georeference.heading": 0.0,
                "georeference.yaw": 1.0,
            },
            "georeference.yaw: is unknown, expected one of lat, lon, heading",
        ),
    ],
)
def test_incomplete_or_invalid_georeference_is_rejected(given, words):
    with pytest.raises(ParameterError, match=re.escape(words)):
        read_run_of(given)
