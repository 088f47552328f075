"""An installed Nav2: its required programs, the missing ones, and the environment of its processes."""

import os
import subprocess
from pathlib import Path

# The nodes of Nav2 that a mission needs, with their packages; the rest of its bring-up is not started.
SERVERS = {
    "map_server": "nav2_map_server",
    "amcl": "nav2_amcl",
    "planner_server": "nav2_planner",
    "controller_server": "nav2_controller",
    "behavior_server": "nav2_behaviors",
    "bt_navigator": "nav2_bt_navigator",
}
MANAGER = ("nav2_lifecycle_manager", "lifecycle_manager")

# The variables that its processes inherit: none of the project's own ROS, whose messages are stand-ins.
_KEPT = ("HOME", "ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE")
HOWTO = "write NAV2_PREFIX=/opt/ros/jazzy, or where Nav2 is installed (docs/how-to/nav2-trees.md#on-a-nav2-that-is-installed)"


def executable(prefix: Path, package: str, name: str) -> Path:
    """Return the path of a program of a package."""
    return prefix / "lib" / package / name


def missing(prefix: str) -> list[str]:
    """Return messages on the missing parts of an installed Nav2; none if missions can run on it."""
    if not prefix:
        return [f"NAV2_PREFIX is not set: {HOWTO}"]
    folder = Path(prefix)
    if not (folder / "setup.bash").is_file():
        return [f"{folder}/setup.bash: there is no such file, so no ROS is installed there; {HOWTO}"]
    programs = [executable(folder, package, name) for name, package in SERVERS.items()]
    return [
        f"{path}: there is no such program (apt install ros-jazzy-{path.parent.name.replace('_', '-')})"
        for path in (*programs, executable(folder, *MANAGER))
        if not os.access(path, os.X_OK)
    ]


def environment(prefix: Path) -> dict[str, str]:
    """Return the environment that `setup.bash` sets up without any other ROS."""
    kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
    done = subprocess.run(
        ["/bin/bash", "-c", '. "$0" && env -0', str(prefix / "setup.bash")],
        env={"PATH": "/usr/local/bin:/usr/bin:/bin", **kept},
        capture_output=True,
        check=True,
    )
    pairs = (entry.partition("=") for entry in done.stdout.decode().split("\0") if entry)
    return {name: value for name, _, value in pairs}


if __name__ == "__main__":
    raise SystemExit("\n".join(f"make: {line}" for line in missing(os.environ.get("NAV2_PREFIX", ""))) or 0)
