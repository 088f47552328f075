"""Parameter files for the runs on Nav2, made from the shipped ones."""

from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parent.parent.parent
CONFIG = ROOT / "config"
NAV2_PARAMS = CONFIG / "nav2_params.yaml"
# Nav2's default of `default_server_timeout`, milliseconds.
NAV2_TIMEOUT_MS = 20


class _Plain(yaml.SafeDumper):
    """Writes repeated values in full, because ROS reads no aliases."""

    def ignore_aliases(self, _):
        return True


def _changed(name, folder, change):
    """Write a copy of a shipped file with parameters changed by a function."""
    content = yaml.safe_load((CONFIG / name).read_text(encoding="utf-8"))
    change(content)
    path = folder / name
    path.write_text(yaml.dump(content, Dumper=_Plain), encoding="utf-8")
    return path


def one_zone_to_sweep(folder):
    """Write parameters of the sweep mission with one zone, and the base in the middle."""

    def change(content):
        given = content["/**"]["ros__parameters"]
        ground = [-5.5, 0.8, -0.8, 0.8, -0.8, 4.5, -5.5, 4.5]
        zone = {"x": -3.0, "y": 3.0, "yaw": 0.0, "poa": 0.5, "pod": 0.6, "look_sec": 20.0}
        given["zones"] = {"zone_a": {**zone, "polygon": ground, "detection_range": 1.5}}
        given["zone_order"] = ["zone_a"]
        given["initial_pose"] = given["base_station"] = {"x": 0.0, "y": 0.0, "yaw": 0.0}

    return _changed("search_sweeps_params.yaml", folder, change)


def one_zone_in_a_wall(folder):
    """Write parameters of the mission with two zones, the second of which is unreachable."""

    def change(content):
        given = content["/**"]["ros__parameters"]
        given["zones"]["zone_b"] = {"x": 6.2, "y": 0.0, "yaw": 0.0}
        given["zone_order"] = ["zone_a", "zone_b"]

    return _changed("mission_params.yaml", folder, change)


def nav2_with_its_own_time_outs(folder):
    """Write Nav2's parameters with its default timeout in place of the shipped one."""

    def change(content):
        given = content["bt_navigator"]["ros__parameters"]
        given["default_server_timeout"] = NAV2_TIMEOUT_MS

    return _changed(NAV2_PARAMS.name, folder, change)
