"""Tests of the mission's launch file."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from unittest.mock import MagicMock

import pytest

from sar_compiler.execution.until import Until
from sar_compiler.resources import find
from tests.launch.launch_file import ROOT, LaunchFile, keyword, texts
from tests.launch.topics import KNOWN, SIMULATED
from tests.processes import BIN, Command
from tests.ros.conftest import Ros

FILE = LaunchFile(ROOT / "launch" / "search_and_rescue.launch.py")

PARTS_OF_LAUNCH = (
    "actions",
    "conditions",
    "descriptions",
    "events.process",
    "launch_description_sources",
    "substitutions",
)

# The arguments that nav2_bringup's bringup_launch.py declares in Jazzy (1.3.13).
BRINGUP = {
    "namespace", "use_namespace", "slam", "map", "use_localization", "use_sim_time", "params_file",
    "autostart", "use_composition", "use_respawn", "log_level",
}  # fmt: skip

COMMANDS = ["sar-run", "sar-sim", "sar-detect-survivor-server", "sar-report-survivor-server"]
WITH_TRANSFORMS = ["sar-run", "sar-sim", "rviz2"]


def test_declared_arguments_are_as_documented():
    assert FILE.declared() == {
        "tree", "params_file", "nav2_params_file", "map", "tick_rate_hz", "until", "journal", "publish", "namespace", "sim", "world",
        "speed", "use_sim_time", "autostart", "rviz", "record", "options",
    }  # fmt: skip


def test_nav2_receives_only_arguments_of_its_bringup():
    (include,) = FILE.calls("IncludeLaunchDescription")
    given = keyword(include, "launch_arguments")
    names = {
        ast.literal_eval(key)
        for node in ast.walk(given)
        if isinstance(node, ast.Dict)
        for key in node.keys
        if key
    }
    assert names == {
        "namespace", "use_namespace", "map", "params_file", "use_sim_time", "autostart",
    }  # fmt: skip
    assert names <= BRINGUP


def test_arguments_of_nav2_are_limited_to_its_group():
    """An include sets its arguments for all later actions, and the mission has a `params_file`, too."""
    (group,) = FILE.calls("GroupAction")
    assert "include" in [name.id for name in ast.walk(group) if isinstance(name, ast.Name)]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_runs_in_namespace(command):
    assert ast.unparse(keyword(FILE.node(command), "namespace")) == "LaunchConfiguration('namespace')"


@pytest.mark.parametrize("command", WITH_TRANSFORMS)
def test_transforms_are_remapped_into_namespace(command):
    assert ast.unparse(keyword(FILE.node(command), "remappings")) == "TRANSFORMS"
    assert FILE.constant("TRANSFORMS") == [("/tf", "tf"), ("/tf_static", "tf_static")]


@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_sets_node_name(command):
    assert ast.unparse(keyword(FILE.node(command), "name")) == "None"


@pytest.mark.parametrize("command", ["sar-run", "sar-sim"])
def test_every_given_option_exists(command):
    given = texts(keyword(FILE.node(command), "arguments"))
    words = [command, "run", "--help"] if command == "sar-sim" else [command, "--help"]
    known = subprocess.run([BIN / words[0], *words[1:]], capture_output=True, text=True, check=True).stdout
    options = [text for text in given if text.startswith("-")]
    assert options
    assert all(f"{option} " in known for option in options)


def test_every_journal_option_exists():
    words = FILE.constant("JOURNAL")
    assert isinstance(words, dict)
    known = subprocess.run([BIN / "sar-run", "--help"], capture_output=True, text=True, check=True).stdout
    assert ast.literal_eval(FILE.default("journal")) in words
    options = [word for each in words.values() for word in each if word.startswith("--")]
    assert len(options) == 3
    assert all(f"{option} " in known for option in options)
    assert "the journal, or none" in known


def test_every_mission_parameter_is_documented():
    documented = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md"))
    names = [texts(call.args[0])[0] for call in FILE.calls("Parameter")]
    assert set(names) == {"tick_rate_hz", "use_sim_time"}
    assert all(f"| `{name}` |" in documented for name in names)


def test_detection_server_reads_parameter_file():
    given = ast.unparse(keyword(FILE.node("sar-detect-survivor-server"), "parameters"))
    assert given.startswith("[LaunchConfiguration('params_file'),")


def test_tick_rate_defaults_to_parameter_file():
    assert ast.literal_eval(FILE.default("tick_rate_hz")) == ""


def test_simulated_time_defaults_to_simulator_argument():
    assert ast.unparse(FILE.default("use_sim_time")) == "LaunchConfiguration('sim')"


@pytest.mark.parametrize(
    ("argument", "kind", "suffix"), [("tree", "trees", ".xml"), ("world", "worlds", ".yaml")]
)
def test_default_tree_and_world_are_shipped(argument, kind, suffix):
    assert find(kind, ast.literal_eval(FILE.default(argument)), suffix).is_file()


def test_mission_runs_until_stopped_by_default():
    assert Until(ast.literal_eval(FILE.default("until"))) is Until.FOREVER


@pytest.mark.parametrize("command", ["sar-run", "sar-sim"])
def test_launch_ends_with_mission_or_simulator(command):
    assert ast.unparse(keyword(FILE.node(command), "on_exit")) == "end_all"


def test_simulation_stays_on_this_machine():
    (call,) = FILE.calls("SetEnvironmentVariable")
    assert texts(call) == ["ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"]
    assert "IfCondition" in ast.unparse(keyword(call, "condition"))


def test_recorded_topics_are_published():
    recorded = FILE.constant("RECORDED")
    assert isinstance(recorded, tuple)
    assert set(recorded) <= KNOWN
    assert FILE.constant("RECORDED_GLOBALLY") == ("/clock", "/rosout", "/diagnostics")


@pytest.fixture
def simulator() -> Iterator[Command]:
    """The simulator, started with the arguments that the launch file gives it for `namespace:=robot1`."""
    remaps = [word for source, name in FILE.constant("TRANSFORMS") for word in ("-r", f"{source}:={name}")]  # type: ignore[attr-defined]
    command = Command(
        "sar-sim", "run", "disaster_zone", "--speed", "1.0", "--ros-args", "-r", "__ns:=/robot1", *remaps
    )
    yield command
    command.stop(within_sec=20.0)


@pytest.mark.ros
def test_simulator_has_topics_of_view_and_recording(simulator: Command, ros: Ros):
    node = ros.node("witness")
    wanted = {f"/robot1/{name}" for name in SIMULATED} | {"/clock"}
    ros.spin_until(
        lambda: wanted <= {name for name, _ in node.get_topic_names_and_types()},
        f"all of {sorted(wanted)}",
    )


@pytest.fixture
def launch_module(monkeypatch):
    """Import the launch file as a module, with mocks for `launch`."""
    for name in ("launch", "launch_ros"):
        for module in (name, *(f"{name}.{part}" for part in PARTS_OF_LAUNCH)):
            monkeypatch.setitem(sys.modules, module, MagicMock())
    spec = spec_from_file_location("its_launch_file", FILE.path)
    assert spec is not None
    assert spec.loader is not None
    launch_module = module_from_spec(spec)
    spec.loader.exec_module(launch_module)
    return launch_module


@pytest.fixture
def require_recorder(launch_module):
    return launch_module.require_recorder


def test_resumed_mission_restores_pose_of_simulated_robot(launch_module, tmp_path, monkeypatch):
    monkeypatch.setattr(launch_module, "state_folder", lambda: tmp_path / "sar_compiler")
    option, places = launch_module.pose_options("robot1", is_resumed=False)
    assert option == "--keep"
    Path(places).write_text("{}")
    assert launch_module.pose_options("robot1", is_resumed=True) == ["--keep", places, "--localised"]
    assert launch_module.pose_options("robot1", is_resumed=False) == ["--keep", places]
    assert not Path(places).exists(), "any other mission begins at the world's start"


def test_recording_is_refused_if_target_exists(require_recorder, tmp_path):
    with pytest.raises(
        FileExistsError, match=f"record:={tmp_path}: the folder exists, .* no process was started"
    ):
        require_recorder(tmp_path)


def test_recording_is_refused_if_parent_folder_is_missing(require_recorder, tmp_path):
    with pytest.raises(
        FileNotFoundError, match=r"the folder .*missing does not exist; no process was started"
    ):
        require_recorder(tmp_path / "missing" / "bag")


@pytest.mark.parametrize("package", ["ros2bag", "rosbag2_storage_mcap"])
def test_recording_is_refused_without_recorder(package, require_recorder, tmp_path, monkeypatch):
    from ament_index_python.packages import PackageNotFoundError

    def there(name):
        if name == package:
            raise PackageNotFoundError(name)

    monkeypatch.setitem(require_recorder.__globals__, "get_package_share_directory", there)
    with pytest.raises(PackageNotFoundError, match=package):
        require_recorder(tmp_path / "bag")


def test_recording_in_new_folder_is_accepted(require_recorder, tmp_path, monkeypatch):
    monkeypatch.setitem(require_recorder.__globals__, "get_package_share_directory", lambda _: None)
    require_recorder(tmp_path / "bag")


def test_recorder_is_checked_before_start():
    (require,) = [each for each in FILE.tree.body if getattr(each, "name", "") == "require"]
    assert "require_recorder" in ast.unparse(require)


def test_further_options_are_passed_to_mission(launch_module, monkeypatch):
    values = {"options": "--nodes 'my leaves'", "journal": "new", "tick_rate_hz": ""}
    monkeypatch.setattr(
        launch_module, "LaunchConfiguration", lambda name: MagicMock(perform=lambda _: values.get(name, ""))
    )
    launch_module.mission(MagicMock())
    assert launch_module.Node.call_args.kwargs["arguments"][3:] == [
        "--new",
        "--nodes",
        "my leaves",
        "--publish",
    ]
