"""Launches the search-and-rescue mission on a robot: Nav2, the two servers, the mission, RViz and a recorder.

`ros2 launch sar_compiler search_and_rescue.launch.py --show-args` lists the arguments. Further arguments, such as
`slam`, `use_composition` and `log_level`, are passed on to Nav2's bringup.
"""
# ruff: noqa: INP001 - a launch file is not imported

import shlex
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    GroupAction,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetEnvironmentVariable,
    Shutdown,
)
from launch.conditions import IfCondition, UnlessCondition
from launch.events.process import ProcessExited
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node, SetRemap
from launch_ros.descriptions import Parameter

from sar_compiler.resources import state_folder

# All names move with the namespace, except these topics, which are absolute in ROS. Nav2 uses the same remappings.
TRANSFORMS = [("/tf", "tf"), ("/tf_static", "tf_static")]

# launch forwards the output line by line, so the processes must not redraw lines.
ENVIRONMENT = {"TERM": "dumb"}

# The values of `journal`, with the options of sar-run.
JOURNAL = {"keep": [], "resume": ["--resume"], "new": ["--new"], "none": ["--journal", "none"]}

# The recorded topics: those in the robot's namespace, and absolute ones.
RECORDED = (
    "tf",
    "tf_static",
    "odometry/filtered",
    "scan",
    "map",
    "amcl_pose",
    "plan",
    "battery_state",
    "cmd_vel",
    "navigate_to_pose/_action/feedback",
    "navigate_to_pose/_action/status",
    "behavior_tree_log",
    "search_and_rescue/tree",
    "search_and_rescue/markers",
)
RECORDED_GLOBALLY = ("/clock", "/rosout", "/diagnostics")


def generate_launch_description() -> LaunchDescription:
    """Return the description that `ros2 launch` runs."""
    share = Path(get_package_share_directory("sar_compiler"))
    simulated = LaunchConfiguration("sim")
    return LaunchDescription(
        [
            *arguments(share),
            OpaqueFunction(function=require),
            # A simulated robot must not send commands to a real one.
            SetEnvironmentVariable(
                "ROS_AUTOMATIC_DISCOVERY_RANGE",
                EnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", default_value="LOCALHOST"),
                condition=IfCondition(simulated),
            ),
            OpaqueFunction(function=navigation, condition=UnlessCondition(simulated)),
            OpaqueFunction(function=simulator, condition=IfCondition(simulated)),
            *servers(),
            view(share),
            OpaqueFunction(function=recording),
            OpaqueFunction(function=mission),
        ]
    )


def arguments(share: Path) -> list[DeclareLaunchArgument]:
    """Return the arguments of the command line.

    Args:
        share: The folder of the package's shipped files.
    """
    declare = DeclareLaunchArgument
    return [
        declare(
            "tree", default_value="search_and_rescue", description="Tree file, or name of a shipped tree"
        ),
        declare(
            "params_file",
            default_value=str(share / "config" / "mission_params.yaml"),
            description="Parameters of the mission",
        ),
        declare(
            "nav2_params_file",
            default_value=str(share / "config" / "nav2_params.yaml"),
            description="Parameters of Nav2",
        ),
        declare(
            "map",
            default_value=str(share / "maps" / "disaster_zone.yaml"),
            description="Map for Nav2",
        ),
        declare(
            "tick_rate_hz",
            default_value="",
            description="Minimum number of ticks per second; empty: the value in params_file",
        ),
        declare(
            "until",
            default_value="forever",
            description="End condition of the mission, as for sar-run --until; all processes end with the mission",
        ),
        declare(
            "journal",
            default_value="keep",
            choices=list(JOURNAL),
            description="keep: write a journal; resume: resume the mission in the journal; new: rename an unfinished journal and start over; none: write no journal",
        ),
        declare(
            "options",
            default_value="",
            description="Further options of sar-run, such as '--nodes my_package.leaves'",
        ),
        declare(
            "publish",
            default_value="true",
            description="Whether to publish the tree's log, diagnostics and markers",
        ),
        declare("namespace", default_value="", description="Namespace of all nodes, such as robot1"),
        declare("sim", default_value="false", description="Whether to simulate the robot and Nav2"),
        declare(
            "world",
            default_value="disaster_zone",
            description="With sim: world file, or name of a shipped world",
        ),
        declare(
            "speed",
            default_value="1.0",
            description="With sim: maximum number of simulated seconds per second",
        ),
        declare(
            "use_sim_time",
            default_value=LaunchConfiguration("sim"),
            description="Whether the nodes use the time on /clock; true with Gazebo",
        ),
        declare(
            "autostart", default_value="true", description="Whether Nav2 activates its nodes at the start"
        ),
        declare("rviz", default_value="true", description="Whether to start RViz"),
        declare(
            "record",
            default_value="",
            description="New folder for a recording of the mission as a bag; empty: no recording",
        ),
    ]


def require(context: LaunchContext) -> None:
    """Check that the required files and packages exist, before any process is started.

    launch only warns about a missing parameter file, and the robot would drive to the shipped zones. If launch
    finds a package missing later, it ends without stopping the processes that it has started.

    Raises:
        FileNotFoundError: If a file is missing.
        FileExistsError: If the folder for the recording exists.
        PackageNotFoundError: If a package is missing.
    """
    simulated = IfCondition(LaunchConfiguration("sim")).evaluate(context)
    files = [LaunchConfiguration("params_file")]
    if not simulated:
        files += [LaunchConfiguration("nav2_params_file"), LaunchConfiguration("map")]
    for path in (Path(file.perform(context)) for file in files):
        if not path.is_file():
            message = f"{path}: the file does not exist; no process was started"
            raise FileNotFoundError(message)
    if not simulated:
        get_package_share_directory("nav2_bringup")
    if IfCondition(LaunchConfiguration("rviz")).evaluate(context):
        get_package_share_directory("rviz2")
    if folder := LaunchConfiguration("record").perform(context):
        require_recorder(Path(folder))


def require_recorder(folder: Path) -> None:
    """Check that a bag can be recorded. Otherwise only the recorder would end, and the mission would not be recorded.

    Args:
        folder: The folder of the bag.

    Raises:
        FileExistsError: If the folder exists.
        FileNotFoundError: If its parent folder is missing.
        PackageNotFoundError: If the recorder or its MCAP plugin is not installed.
    """
    if folder.exists():
        message = f"record:={folder}: the folder exists, but a bag needs a new folder; no process was started"
        raise FileExistsError(message)
    if not folder.absolute().parent.is_dir():
        message = (
            f"record:={folder}: the folder {folder.absolute().parent} does not exist; no process was started"
        )
        raise FileNotFoundError(message)
    get_package_share_directory("ros2bag")
    get_package_share_directory("rosbag2_storage_mcap")


def navigation(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return the launch file of Nav2, which must be installed."""
    namespace = own_namespace(context)
    bringup = Path(get_package_share_directory("nav2_bringup")) / "launch" / "bringup_launch.py"
    # The costmaps have namespaces of their own, in which a relative `scan` would be `local_costmap/scan`. So nav2_params.yaml
    # contains `/scan`, and this remapping moves it into the robot's namespace.
    scan = [SetRemap("/scan", f"/{namespace}/scan")] if namespace else []
    include = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(bringup)),
        launch_arguments={
            "namespace": namespace,
            "use_namespace": str(bool(namespace)),
            "map": LaunchConfiguration("map"),
            "params_file": LaunchConfiguration("nav2_params_file"),
            "use_sim_time": LaunchConfiguration("use_sim_time"),
            "autostart": LaunchConfiguration("autostart"),
        }.items(),
    )
    # Without a group, Nav2's `params_file` would also be set for the mission.
    return [GroupAction([*scan, include])]


def simulator(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return the simulator of the world and of Nav2."""
    resumed = LaunchConfiguration("journal").perform(context) == "resume"
    return [
        Node(
            package="sar_compiler",
            executable="sar-sim",
            namespace=LaunchConfiguration("namespace"),
            arguments=[
                *("run", LaunchConfiguration("world"), "--speed", LaunchConfiguration("speed")),
                *pose_options(own_namespace(context), is_resumed=resumed),
            ],
            remappings=TRANSFORMS,
            output="screen",
            emulate_tty=True,
            additional_env=ENVIRONMENT,
            on_exit=end_all,
        )
    ]


def pose_options(namespace: str, *, is_resumed: bool) -> list[str]:
    """Return the options for the robot's initial pose: its last pose for a resumed mission, otherwise the start.

    Args:
        namespace: The robot's namespace.
        is_resumed: Whether the mission is resumed. A resumed mission does not set an initial pose.
    """
    name = "_".join(["launched_simulation", *namespace.split("/")])
    places = state_folder() / f"{name}.json"
    places.parent.mkdir(parents=True, exist_ok=True)
    if not is_resumed:
        places.unlink(missing_ok=True)
    return ["--keep", str(places), *(["--localised"] if places.is_file() else [])]


def servers() -> list[Node]:
    """Return the servers that detect survivors and receive reports."""
    time = Parameter("use_sim_time", LaunchConfiguration("use_sim_time"))
    return [
        Node(
            package="sar_compiler",
            executable="sar-detect-survivor-server",
            namespace=LaunchConfiguration("namespace"),
            # The file may contain the survivors for this server.
            parameters=[LaunchConfiguration("params_file"), time],
            output="screen",
            emulate_tty=True,
        ),
        Node(
            package="sar_compiler",
            executable="sar-report-survivor-server",
            namespace=LaunchConfiguration("namespace"),
            parameters=[time],
            output="screen",
            emulate_tty=True,
        ),
    ]


def mission(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return the node that runs the tree. If it ends for any reason, all processes end."""
    # Single parameters take precedence over a file, even over a section for the node's name.
    parameters = [
        LaunchConfiguration("params_file"),
        Parameter("use_sim_time", LaunchConfiguration("use_sim_time")),
    ]
    if LaunchConfiguration("tick_rate_hz").perform(context):
        parameters.append(Parameter("tick_rate_hz", LaunchConfiguration("tick_rate_hz")))
    options = [*JOURNAL[LaunchConfiguration("journal").perform(context)]]
    options += shlex.split(LaunchConfiguration("options").perform(context))
    if IfCondition(LaunchConfiguration("publish")).evaluate(context):
        options.append("--publish")
    return [
        Node(
            package="sar_compiler",
            executable="sar-run",
            namespace=LaunchConfiguration("namespace"),
            arguments=[LaunchConfiguration("tree"), "--until", LaunchConfiguration("until"), *options],
            parameters=parameters,
            remappings=TRANSFORMS,
            output="screen",
            emulate_tty=True,
            additional_env=ENVIRONMENT,
            on_exit=end_all,
        )
    ]


def view(share: Path) -> Node:
    """Return RViz with the view of the mission. The mission continues if RViz is closed.

    Args:
        share: The folder of the package's shipped files.
    """
    return Node(
        condition=IfCondition(LaunchConfiguration("rviz")),
        package="rviz2",
        executable="rviz2",
        namespace=LaunchConfiguration("namespace"),
        arguments=["-d", str(share / "rviz" / "search_and_rescue.rviz")],
        parameters=[{"use_sim_time": LaunchConfiguration("use_sim_time")}],
        remappings=TRANSFORMS,
        output="screen",
        emulate_tty=True,
    )


def recording(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return the recorder, if the argument `record` is set."""
    folder = LaunchConfiguration("record").perform(context)
    if not folder:
        return []
    namespace = own_namespace(context)
    topics = [f"/{namespace}/{name}" if namespace else f"/{name}" for name in RECORDED]
    return [
        ExecuteProcess(
            # Feedback and status of an action are hidden topics.
            cmd=[
                *("ros2", "bag", "record", "--output", folder, "--storage", "mcap"),
                *("--include-hidden-topics", "--disable-keyboard-controls"),
                *("--topics", *topics, *RECORDED_GLOBALLY),
            ],
            output="screen",
            emulate_tty=True,
        )
    ]


def end_all(event: ProcessExited, context: LaunchContext) -> Shutdown | None:
    """End all processes after one of the required processes has ended.

    A second shutdown during the first one would raise an error in launch's ROS node, which Nav2 uses.
    """
    return None if context.is_shutdown else Shutdown(reason=f"{event.process_name} has ended")


def own_namespace(context: LaunchContext) -> str:
    """Return the namespace without surrounding slashes, as Nav2's bringup requires; empty without a namespace."""
    return LaunchConfiguration("namespace").perform(context).strip("/")
