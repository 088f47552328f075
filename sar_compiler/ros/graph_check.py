"""Detect topics, clocks and frames with several sources in the ROS graph, without a mission."""

import time

from rclpy.context import Context
from rclpy.node import Node

from sar_compiler.ros.frame_sources import frame_sources
from sar_compiler.ros.graph_queries import ros_graph

# Duration of the search, in seconds: three times the time in which half of the participants on one machine discover each other. The second value is
# the interval of the checks.
_LOOK_SEC, _TURN_SEC = 1.0, 0.1


def find_conflicts(look_sec: float = _LOOK_SEC) -> list[str]:
    """Describe the topics, clocks and frames that should have one source, but have several.

    Args:
        look_sec: How long to observe the ROS graph, in seconds.
    """
    context = Context()
    context.init(initialize_logging=False)
    try:
        node = Node("mission_doctor", context=context, start_parameter_services=False)
        sources, deadline = frame_sources(node), time.monotonic() + look_sec
        while not (conflict := sources.conflict()) and time.monotonic() < deadline:
            time.sleep(_TURN_SEC)
        return [*ros_graph(node).contested_topics(), *filter(None, [conflict])]
    finally:
        context.try_shutdown()
