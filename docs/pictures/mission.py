"""Draw the picture of the mission: `python docs/pictures/mission.py`, with ROS 2, writes `mission.svg` into the same folder.

A mission runs in the simulator. The animated picture shows its world and the robot's path.
"""

import math
import subprocess
import sys
from pathlib import Path

import rclpy
from nav_msgs.msg import Odometry

from sar_compiler.sim.world import find_world
from sar_compiler.style import COLOURS, MARKS

WORLD = "disaster_zone"
SURVIVORS = {"survivor_1": (-2.5, 3.2), "survivor_2": (4.1, -2.5)}
SPEED = 5
"""Simulated seconds per second, in the simulator and in the picture."""
STEP_SEC = 0.5
"""The time between two points of the path, simulated seconds."""


def record_path() -> list[tuple[float, float, float]]:
    """Run the mission, and return the points of the robot's path: simulated seconds, x and y in metres in the frame `map`."""
    rclpy.init()
    node = rclpy.create_node("picture")
    path: list[tuple[float, float, float]] = []

    def on_odometry(odometry: Odometry) -> None:
        stamp, at = odometry.header.stamp, odometry.pose.pose.position
        seconds = stamp.sec + stamp.nanosec * 1e-9
        if not path or seconds >= path[-1][0] + STEP_SEC:
            path.append((seconds, at.x, at.y))

    node.create_subscription(Odometry, "odometry/filtered", on_odometry, 10)
    command = [str(Path(sys.executable).with_name("sar-run")), "--sim", WORLD, "--speed", str(SPEED)]
    with subprocess.Popen(command) as mission:  # noqa: S603 - our own command
        while mission.poll() is None:
            rclpy.spin_once(node, timeout_sec=0.1)
    return path


def _colour(name: str) -> str:
    return COLOURS[name].light


def picture(path: list[tuple[float, float, float]]) -> str:
    """Return the world and a path in it as SVG."""
    world = find_world(WORLD)
    start, end = path[0][0], path[-1][0]
    points = " ".join(f"{x:.2f},{y:.2f}" for _, x, y in path)
    times = ";".join(f"{(seconds - start) / (end - start):.4f}" for seconds, _, _ in path)
    values = ";".join(f"{x:.2f} {y:.2f}" for _, x, y in path)
    shapes = [
        f'<rect x="{-box.size_x / 2}" y="{-box.size_y / 2}" width="{box.size_x}" height="{box.size_y}" '
        f'transform="translate({box.x} {box.y}) rotate({math.degrees(box.yaw):.1f})"/>'
        for box in world.boxes
    ]
    shapes += [f'<circle cx="{each.x}" cy="{each.y}" r="{each.radius}"/>' for each in world.cylinders]
    zones = [f'<circle cx="{x}" cy="{y}" r="0.45"/>' for x, y in world.places.values()]
    found = [
        f'<path transform="translate({x} {y}) scale(0.015 -0.015)" d="{MARKS["triangle"]}"/>'
        for x, y in SURVIVORS.values()
    ]
    below = {name: (x, 0.75 - y) for name, (x, y) in {**world.places, "base": (0.0, 0.0)}.items()}
    above = {name: (x, -0.25 - y) for name, (x, y) in SURVIVORS.items()}
    names = [f'<text x="{x:.2f}" y="{y:.2f}">{name}</text>' for name, (x, y) in {**below, **above}.items()]
    return f"""\
<svg xmlns="http://www.w3.org/2000/svg" viewBox="-6.3 -5.3 12.6 10.6" width="630" height="530">
<!-- Made by docs/pictures/mission.py; do not edit. -->
<rect x="-6.3" y="-5.3" width="12.6" height="10.6" fill="{_colour("ground")}"/>
<g transform="scale(1 -1)">
<g fill="{_colour("chosen")}">{"".join(zones)}</g>
<g fill="{_colour("halted")}">{"".join(shapes)}</g>
<polyline points="{points}" fill="none" stroke="{_colour("trail")}" stroke-width="0.05"/>
<g fill="{_colour("warning")}" stroke="{_colour("text")}" stroke-width="2">{"".join(found)}</g>
<circle r="{world.robot_radius}" fill="{_colour("robot")}">
<animateTransform attributeName="transform" type="translate" dur="{(end - start) / SPEED:.1f}s" repeatCount="indefinite"
 keyTimes="{times}" values="{values}"/>
</circle>
</g>
<g font-family="sans-serif" font-size="0.3" text-anchor="middle" fill="{_colour("text")}">{"".join(names)}</g>
</svg>
"""


if __name__ == "__main__":
    Path(__file__).with_suffix(".svg").write_text(picture(record_path()), encoding="utf-8")
