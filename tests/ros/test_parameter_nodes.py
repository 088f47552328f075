"""Tests of parameters as real nodes read them, and of ROS arguments."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from sar_compiler.missions.parameter_file import (
    ParameterFileError,
    check_parameter_file,
    rcl_kind,
    read_parameter_file,
)
from sar_compiler.missions.parameter_reader import ParameterReader, read_run
from sar_compiler.resources import shipped_root

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from tests.ros.conftest import Ros

pytestmark = pytest.mark.ros

NAME = "search_and_rescue"


class Launch:
    """Starts a node as a command does, from a parameter file and the user's own ROS arguments."""

    def __init__(self, make_ros: Callable[..., Ros], folder: Path) -> None:
        self._make_ros = make_ros
        self._folder = folder

    def file(self, text: str, name: str = "params.yaml") -> Path:
        path = self._folder / name
        path.write_text(text)
        return path

    def node(self, ros: Sequence[str] = (), params: Path | None = None) -> Any:
        from sar_compiler.ros.arguments import convert_ros_errors, init_arguments, node_arguments
        from sar_compiler.ros.parameters import DataNode

        with convert_ros_errors():
            stage = self._make_ros(init_arguments(ros, params))
        return stage.add(DataNode(NAME, stage.context, node_arguments(ros)))

    def values(self, ros: Sequence[str] = (), params: Path | None = None) -> dict[str, object]:
        from sar_compiler.ros.parameters import flat_parameters

        return flat_parameters(self.node(ros, params))

    def error(self, *ros: str) -> str:
        from sar_compiler.ros.arguments import RosArgumentError

        with pytest.raises(RosArgumentError) as caught:
            self.node(ros)
        assert "/src/" not in str(caught.value)
        return str(caught.value)


@pytest.fixture
def launch(make_ros: Callable[..., Ros], tmp_path: Path) -> Launch:
    return Launch(make_ros, tmp_path)


def section(name: str, value: object, key: str = "x") -> str:
    return f"{name}:\n  ros__parameters:\n    {key}: {value}\n"


class TestFiles:
    def test_shipped_file_is_a_mission(self, launch: Launch) -> None:
        reader = ParameterReader(launch.values(params=shipped_root() / "config" / "mission_params.yaml"))
        zones, run = reader.places("zone"), read_run(reader)
        reader.complain()
        assert [zone["id"] for zone in zones] == ["zone_a", "zone_b", "zone_c", "zone_d"]
        assert zones[1] == {"id": "zone_b", "x": 3.5, "y": 3.0, "yaw": 1.57}
        assert (run.tick_rate_hz, run.set_initial_pose, reader.notes) == (2.0, True, [])

    def test_integers_lists_and_booleans_keep_their_types(self, launch: Launch) -> None:
        path = launch.file(
            "/**:\n  ros__parameters: {x: 3, on: off, ints: [1, 2], floats: [1.5], words: [a, b]}\n"
        )
        values = launch.values(params=path)
        assert {key: values[key] for key in ("x", "on", "ints", "floats", "words")} == {
            "x": 3,
            "on": False,
            "ints": [1, 2],
            "floats": [1.5],
            "words": ["a", "b"],
        }

    @pytest.mark.parametrize(
        ("name", "namespace"),
        [
            ("/**", "/"),
            ("/**", "/group3"),
            (NAME, "/"),
            (f"/{NAME}", "/"),
            (f"/group3/{NAME}", "/group3"),
            ("/group3/*", "/group3"),
            ("/group3/**", "/group3/deep"),
            (f"/**/{NAME}", "/group3"),
        ],
    )
    def test_section_reaches_node_it_names(self, launch: Launch, name: str, namespace: str) -> None:
        path = launch.file(section(name, 5))
        assert launch.values(["-r", f"__ns:={namespace}"], path)["x"] == 5

    @pytest.mark.parametrize("name", ["/other", "/group4/*", f"/group4/{NAME}"])
    def test_section_of_other_node_is_ignored(self, launch: Launch, name: str) -> None:
        assert "x" not in launch.values(["-r", "__ns:=/group3"], launch.file(section(name, 5)))

    @pytest.mark.parametrize(
        "name", ["/**", NAME, "both", "both, the other way round"], ids=["all", "own", "both", "reversed"]
    )
    def test_command_line_overrides_file(self, launch: Launch, name: str) -> None:
        both = [section("/**", "all"), section(NAME, "own")]
        texts = {"both": both, "both, the other way round": both[::-1]}
        path = launch.file("".join(texts.get(name, [section(name, "file")])))
        assert launch.values(["-p", "x:=mine"], path)["x"] == "mine"

    def test_command_line_overrides_file_for_renamed_node(self, launch: Launch) -> None:
        path = launch.file(section("/**", "all") + section("/g/mine", "own"))
        arguments = ["-r", "__node:=mine", "-r", "__ns:=/g", "-p", "x:=given"]
        assert launch.values(arguments, path)["x"] == "given"

    def test_file_read_without_ros_matches_ros(self, launch: Launch) -> None:
        scalars = "1 -3 +0x10 -0x1.8p3 .5 1e3 .inf -.INF .NaN inf yes OFF tRUE '12' \"off\" a 3m,5"
        lines = "".join(f"    k{i}: {text}\n" for i, text in enumerate([*scalars.split(), "!!str 3"]))
        path = launch.file(
            f"/**:\n  ros__parameters:\n{lines}    a: {{b: {{c: [1.5, 2.0]}}, d: [x, 'y']}}\n    over: 1\n"
            f"{NAME}:\n  ros__parameters: {{over: 2, a.b.e: [on, n]}}\n"
            "/other/*:\n  ros__parameters: {over: 3, mine: false}\n"
        )
        read, given = read_parameter_file(path, f"/{NAME}"), launch.values(params=path)
        assert {"a.b.c", "a.b.e", "over"} < set(read)
        assert {key: repr(value) for key, value in read.items()} == {key: repr(given[key]) for key in read}
        assert set(given) - set(read) <= {"use_sim_time", "start_type_description_service"}

    def test_user_file_overrides_first_file(self, launch: Launch) -> None:
        first, second = launch.file(section("/**", 1)), launch.file(section("/**", 2), "own.yaml")
        assert launch.values(["--params-file", str(second)], first)["x"] == 2

    def test_later_argument_overrides_earlier_one(self, launch: Launch) -> None:
        own = launch.file(section("/**", 2))
        assert launch.values(["-p", "x:=1", "--params-file", str(own)])["x"] == 2
        assert launch.values(["--params-file", str(own), "-p", "x:=1"])["x"] == 1

    def test_invalid_user_file_is_reported(self, launch: Launch) -> None:
        path = launch.file(section("/**", "[1, 2.0]"))
        with pytest.raises(ParameterFileError, match="mixes"):
            launch.values(["--params-file", str(path)])


class TestFileCheck:
    @pytest.mark.parametrize(
        "text",
        [
            *(
                "x: []",
                "x: {}",
                "x: [1, 2.0]",
                "x: [a, 1]",
                "x: [[1], [2]]",
                "x:",
                "x: &a 1\n    y: *a",
                "x: [1",
            ),
            *("x 1", "? [a]\n    : 1", "x: [true, 1]", "\tx: 1", "x: 'a"),
        ],
    )
    def test_check_rejects_files_that_ros_rejects(self, launch: Launch, text: str) -> None:
        path = launch.file(f"/**:\n  ros__parameters:\n    {text}\n")
        with pytest.raises(ParameterFileError):
            check_parameter_file(path)
        # Bypasses the check, to ensure that ROS rejects the values above.
        assert self.is_rejected_by_ros(launch, path)

    @pytest.mark.parametrize(
        "text",
        [
            "- a",
            "x: 1",
            "/**:\n  x: 1",
            "ros__parameters:\n  x: 1",
            "/**:\n  ros__parameters:",
            "%YAML 1.2\n---\n",
        ],
    )
    def test_check_rejects_files_without_valid_sections(self, launch: Launch, text: str) -> None:
        path = launch.file(text + "\n")
        with pytest.raises(ParameterFileError):
            check_parameter_file(path)

    def is_rejected_by_ros(self, launch: Launch, path: Path) -> bool:
        from rclpy.exceptions import ParameterException
        from rclpy.impl.implementation_singleton import rclpy_implementation as rcl

        from sar_compiler.ros.arguments import RosArgumentError
        from sar_compiler.ros.parameters import DataNode

        try:
            stage = launch._make_ros(["--ros-args", "--params-file", str(path)])
            DataNode(NAME, stage.context)
        except (rcl.RCLError, RosArgumentError, ParameterException):
            return True
        return False

    def test_scalar_kinds_match_ros(self, launch: Launch) -> None:
        scalars = [
            "1",
            "-3",
            "+3",
            "007",
            "010",
            "08",
            "0x10",
            "0xfg",
            "0b11",
            "0o10",
            "1_000",
            "1.0",
            ".5",
            "5.",
            "1e3",
            "1E-3",
            "1.e+3",
            ".e5",
            "1e999",
            "-1e400",
            "0x1p3",
            "0x1.8",
            "1e",
            "1.2.3",
            "99999999999999999999",
            "9223372036854775807",
            "-9223372036854775808",
            "9223372036854775808",
            ".nan",
            ".NaN",
            ".inf",
            "-.inf",
            "+.inf",
            ".Inf",
            ".INF",
            "nan",
            "inf",
            "-inf",
            "infinity",
            "-Infinity",
            "NaN",
            "y",
            "Y",
            "yes",
            "Yes",
            "YES",
            "n",
            "N",
            "no",
            "on",
            "On",
            "ON",
            "off",
            "Off",
            "true",
            "True",
            "TRUE",
            "false",
            "yEs",
            "tRUE",
            "12:30",
            "2020-01-01",
            "a",
            "3m",
            "1,5",
            "--",
            "+",
        ]
        text = "".join(f"    k{index}: {scalar}\n" for index, scalar in enumerate(scalars))
        values = self.unchecked(launch, text)
        kinds = {bool: "a Boolean", int: "an integer", float: "a number", str: "text"}
        read = {scalar: kinds[type(values[f"k{index}"])] for index, scalar in enumerate(scalars)}
        assert read == {scalar: rcl_kind(scalar) for scalar in scalars}

    def unchecked(self, launch: Launch, text: str) -> dict[str, object]:
        from sar_compiler.ros.parameters import DataNode, flat_parameters

        path = launch.file("/**:\n  ros__parameters:\n" + text, "scalars.yaml")
        stage = launch._make_ros(["--ros-args", "--params-file", str(path)])
        return flat_parameters(stage.add(DataNode(NAME, stage.context)))


class TestArguments:
    def test_ros_arguments_are_split_from_own_arguments(self) -> None:
        from sar_compiler.ros.arguments import split_arguments

        split = split_arguments(["a", "--ros-args", "-p", "x:=1", "--", "b", "--ros-args", "-r", "c:=d"])
        assert (split.own, split.ros) == (["a", "b"], ["-p", "x:=1", "-r", "c:=d"])

    def test_no_arguments_give_empty_lists(self) -> None:
        from sar_compiler.ros.arguments import init_arguments, node_arguments

        assert (init_arguments([]), node_arguments([])) == ([], [])

    @pytest.mark.parametrize(
        ("ros", "parts"),
        [
            (["-p"], ["-p must be followed by a value"]),
            (["--params-file"], ["--params-file must be followed by a value"]),
            (["-p", "x"], ["'-p x' is invalid", "name:=value"]),
            (["-p", "x:="], ["'-p x:='", "name:=value"]),
            (["-p", "x:=[1, 2.0]"], ["'-p x:=[1, 2.0]'", "the same type"]),
            (["-p", "x:={a: 1}"], ["'-p x:={a: 1}'"]),
            (["-p", "x:='"], ["'-p x:='"]),
            (["-r", "foo"], ["'-r foo' is invalid", "from:=to"]),
            (
                ["-r", "__ns:=front"],
                ["'-r __ns:=front'", "a namespace must begin with a slash: __ns:=/front"],
            ),
            (["-r", "camera:__ns:=front"], ["begin with a slash: camera:__ns:=/front"]),
            (["-r", "__ns:=/front-1"], ["'-' is not allowed in a name: use letters, digits, _ and /"]),
            (["-r", "image_raw:=/bad-name"], ["'-' is not allowed in a name"]),
            (["-r", "bad-name:=image_raw"], ["'-' is not allowed in a name"]),
            (["-r", "__ns:=/1st"], ["each part of a name between slashes must begin with a letter or _"]),
            (["-r", "image_raw:=a//b"], ["a name is missing between or after slashes"]),
            (["-r", "image_raw:="], ["a name is missing after :="]),
            (["-r", "__ns:=/a__b"], ["a name cannot contain two consecutive underscores"]),
            (["-r", "__node:=/front"], ["a node name cannot contain a slash"]),
            (["-r", "__node:=1bad"], ["'-r __node:=1bad'"]),
            (["--log-level", "loud"], ["'--log-level loud'", "debug, info"]),
            (["--unknown"], ["unknown ROS argument: --unknown"]),
            (["-p", "x:=1", "stray", "more"], ["unknown ROS argument: stray, more"]),
            (["-e", "/x y"], ["the ROS arguments are invalid", "Enclave"]),
        ],
    )
    def test_invalid_ros_argument_is_explained(
        self, launch: Launch, ros: list[str], parts: list[str]
    ) -> None:
        text = launch.error(*ros)
        assert all(part in text for part in parts), text

    def test_empty_list_error_names_parameter(self, launch: Launch) -> None:
        assert "parameter zone_order: ROS cannot infer the type of an empty list" in launch.error(
            "-p", "zone_order:=[]"
        )

    def test_use_sim_time_must_be_true_or_false(self, launch: Launch) -> None:
        assert "use_sim_time must be true or false, but is 3" in launch.error("-p", "use_sim_time:=3")
        assert launch.values(["-p", "use_sim_time:=true"])["use_sim_time"] is True

    def test_invalid_node_name_is_explained(self, ros: Ros) -> None:
        from sar_compiler.ros.arguments import RosArgumentError
        from sar_compiler.ros.parameters import DataNode

        with pytest.raises(RosArgumentError, match="1bad"):
            DataNode("1bad", ros.context)
