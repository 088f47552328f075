"""The search-and-rescue mission on a robot: Nav2, the two servers, the mission, RViz and a recording.

`ros2 launch sar_compiler search_and_rescue.launch.py --show-args` lists the arguments. Arguments of Nav2's own
bringup that are not among them (`slam`, `use_composition`, `log_level`) reach it, too.
"""
# ruff: noqa: INP001 - nobody imports a launch file

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

# Everything moves with the namespace but these, which are absolute everywhere in ROS; Nav2 does the same.
TRANSFORMS = [("/tf", "tf"), ("/tf_static", "tf_static")]

# Launch passes on line by line what processes say, so nothing can be overwritten.
PASSED_ON = {"TERM": "dumb"}

# What `journal` can be, as options of sar-run.
JOURNAL = {"keep": [], "resume": ["--resume"], "new": ["--new"], "none": ["--journal", "none"]}

# What tells of a mission afterwards. The first are of the robot's namespace, the others of nobody's.
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
    """Return what `ros2 launch` runs."""
    share = Path(get_package_share_directory("sar_compiler"))
    simulated = LaunchConfiguration("sim")
    return LaunchDescription(
        [
            *arguments(share),
            OpaqueFunction(function=require),
            # A simulated robot must never steer a real one.
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
    """Return what can be said on the command line.

    Args:
        share: The folder of the package's shipped files.
    """
    declare = DeclareLaunchArgument
    return [
        declare("tree", default_value="search_and_rescue", description="Tree file, or a shipped tree's name"),
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
            description="Map of the robot's surroundings, for Nav2",
        ),
        declare(
            "tick_rate_hz",
            default_value="",
            description="Ticks a second at least; empty: as params_file says",
        ),
        declare(
            "until",
            default_value="forever",
            description="When the mission ends, and all of this with it: as sar-run --until",
        ),
        declare(
            "journal",
            default_value="keep",
            choices=list(JOURNAL),
            description="keep the mission's journal, resume the mission in it, begin a new one beside it, or none",
        ),
        declare(
            "publish", default_value="true", description="Publish the tree's log, diagnostics and markers"
        ),
        declare("namespace", default_value="", description="Namespace of everything, such as robot1"),
        declare("sim", default_value="false", description="Simulate the robot and Nav2"),
        declare(
            "world", default_value="disaster_zone", description="With sim: a world's file or shipped name"
        ),
        declare("speed", default_value="1.0", description="With sim: simulated seconds per second, at most"),
        declare(
            "use_sim_time",
            default_value=LaunchConfiguration("sim"),
            description="Whether time comes from /clock; write true with Gazebo",
        ),
        declare("autostart", default_value="true", description="Whether Nav2 becomes active by itself"),
        declare("rviz", default_value="true", description="Whether to show it all in RViz"),
        declare(
            "record", default_value="", description="Folder for a bag of the mission; empty: no recording"
        ),
    ]


def require(context: LaunchContext) -> None:
    """See that the files and packages are there that were asked for, before anything is started.

    Launch only warns of a parameter file that is not there, and the mission would fly to the shipped zones.
    When it misses a package halfway, it ends and leaves running what it has started.

    Raises:
        FileNotFoundError: If a file is missing.
        FileExistsError: If there is something where the recording is to be.
        PackageNotFoundError: If a package is missing.
    """
    simulated = IfCondition(LaunchConfiguration("sim")).evaluate(context)
    files = [LaunchConfiguration("params_file")]
    if not simulated:
        files += [LaunchConfiguration("nav2_params_file"), LaunchConfiguration("map")]
    for path in (Path(file.perform(context)) for file in files):
        if not path.is_file():
            message = f"{path}: there is no such file; nothing has been started"
            raise FileNotFoundError(message)
    if not simulated:
        get_package_share_directory("nav2_bringup")
    if IfCondition(LaunchConfiguration("rviz")).evaluate(context):
        get_package_share_directory("rviz2")
    if folder := LaunchConfiguration("record").perform(context):
        require_recorder(Path(folder))


def require_recorder(folder: Path) -> None:
    """See that a bag can be recorded; the recorder would end by itself, and the mission fly unrecorded.

    Args:
        folder: Where the bag is to be.

    Raises:
        FileExistsError: If there is something already.
        FileNotFoundError: If the folder around it is missing.
        PackageNotFoundError: If the recorder, or what writes MCAP, is not installed.
    """
    if folder.exists():
        message = (
            f"record:={folder}: it is there already, and a bag needs a new folder; nothing has been started"
        )
        raise FileExistsError(message)
    if not folder.absolute().parent.is_dir():
        message = f"record:={folder}: there is no folder {folder.absolute().parent}; nothing has been started"
        raise FileNotFoundError(message)
    get_package_share_directory("ros2bag")
    get_package_share_directory("rosbag2_storage_mcap")


def navigation(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Include Nav2; with `sim:=true` it need not be installed."""
    namespace = own_namespace(context)
    bringup = Path(get_package_share_directory("nav2_bringup")) / "launch" / "bringup_launch.py"
    # The costmaps are nodes one namespace further down. For them a relative `scan` would be
    # `local_costmap/scan`, so nav2_params.yaml says `/scan`, and this leads it back.
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
    # A group, because an include's arguments would otherwise stay: Nav2's `params_file` for the mission.
    return [GroupAction([*scan, include])]


def simulator(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return the world and the stand-in for Nav2."""
    resumed = LaunchConfiguration("journal").perform(context) == "resume"
    return [
        Node(
            package="sar_compiler",
            executable="sar-sim",
            namespace=LaunchConfiguration("namespace"),
            arguments=[
                *("run", LaunchConfiguration("world"), "--speed", LaunchConfiguration("speed")),
                *keeping(own_namespace(context), resumed=resumed),
            ],
            remappings=TRANSFORMS,
            output="screen",
            emulate_tty=True,
            additional_env=PASSED_ON,
            on_exit=end_all,
        )
    ]


def keeping(namespace: str, *, resumed: bool) -> list[str]:
    """Return the options by which a mission that is resumed finds its robot where it stood, any other at the start.

    Args:
        namespace: The robot's.
        resumed: Whether the mission goes on with a journal: nobody tells its robot a pose.
    """
    name = "_".join(["launched_simulation", *namespace.split("/")])
    places = state_folder() / f"{name}.json"
    places.parent.mkdir(parents=True, exist_ok=True)
    if not resumed:
        places.unlink(missing_ok=True)
    return ["--keep", str(places), *(["--localised"] if places.is_file() else [])]


def servers() -> list[Node]:
    """Return the servers that detect survivors and take reports of them."""
    time = Parameter("use_sim_time", LaunchConfiguration("use_sim_time"))
    return [
        Node(
            package="sar_compiler",
            executable="sar-detect-survivor-server",
            namespace=LaunchConfiguration("namespace"),
            # The file may have a table of survivors, which is for this server.
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
    """Return the tree's node; without it, whatever the reason, nothing is left driving."""
    # Single parameters win over a file, also over a section of its that has the node's name.
    parameters = [
        LaunchConfiguration("params_file"),
        Parameter("use_sim_time", LaunchConfiguration("use_sim_time")),
    ]
    if LaunchConfiguration("tick_rate_hz").perform(context):
        parameters.append(Parameter("tick_rate_hz", LaunchConfiguration("tick_rate_hz")))
    options = [*JOURNAL[LaunchConfiguration("journal").perform(context)]]
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
            additional_env=PASSED_ON,
            on_exit=end_all,
        )
    ]


def view(share: Path) -> Node:
    """Return RViz with the mission's view; closing it changes nothing.

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
    """Return the recorder, if there is a folder for its bag."""
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
    """End everything when a process ends without which the rest makes no sense.

    A second shutdown during the first would be an error of launch's (of its ROS node, which Nav2 uses).
    """
    return None if context.is_shutdown else Shutdown(reason=f"{event.process_name} has ended")


def own_namespace(context: LaunchContext) -> str:
    """Return the namespace without slashes around it, as Nav2's bringup wants it; empty if there is none."""
    return LaunchConfiguration("namespace").perform(context).strip("/")
