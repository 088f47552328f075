"""Leaves for what ROS offers, without a line of Python: `--model ros:jazzy`."""

from collections.abc import Sequence
from typing import Literal

from sar_compiler.nodes.declaring import attribute, leaf_spec, output_port
from sar_compiler.nodes.spec import Kind, NodeSpec, Use
from sar_compiler.nodes.values import Seconds
from sar_compiler.runtime.answers import Answer

VERSIONS = ("jazzy",)
_HERE = "sar_compiler.ros.leaves.by_attributes"
_VALUE = output_port("value", object, "Where it is written.", None)
_SERVER = attribute("server_timeout_sec", Seconds, "How long to wait for a server, seconds.", 10.0)
_SPECS = (
    leaf_spec(
        f"{_HERE}:RosService",
        "Call a service: SUCCESS when it has answered, and has not said no.",
        attribute("service", str, "The service's name."),
        attribute("type_", str, "Its type, such as `std_srvs/srv/SetBool`."),
        attribute(
            "request",
            str,
            "The request's fields as YAML, without the braces around: `data: true`.",
            "",
        ),
        attribute("success", str, "A field of the answer that must be true; empty for none.", ""),
        attribute("field", str, "A field of the answer to write to `value`, such as `location.x`.", ""),
        _VALUE,
        _SERVER,
        attribute("timeout_sec", Seconds, "How long to wait for the answer, seconds.", 5.0),
        uses=(Use.service("{service}"),),
        effects="calls a service",
        answers=(
            Answer("SUCCESS", "answered"),
            Answer("FAILURE", "not answered"),
            Answer("RUNNING", "calling"),
        ),
    ),
    leaf_spec(
        f"{_HERE}:RosAction",
        "Send a goal to an action: RUNNING until it has ended, SUCCESS if it has succeeded.",
        attribute("action", str, "The action's name."),
        attribute("type_", str, "Its type, such as `nav2_msgs/action/Wait`."),
        attribute("goal", str, "The goal's fields as YAML, without the braces around: `time: {sec: 5}`.", ""),
        attribute("field", str, "A field of the result to write to `value`.", ""),
        _VALUE,
        _SERVER,
        attribute(
            "acceptance_timeout_sec", Seconds, "How long to wait for the goal to be accepted, seconds.", 5.0
        ),
        uses=(Use.action("{action}"),),
        effects="has a goal carried out",
        answers=(Answer("SUCCESS", "succeeded"), Answer("FAILURE", "failed"), Answer("RUNNING", "under way")),
    ),
    leaf_spec(
        f"{_HERE}:RosTopic",
        "Is there a message of a topic? SUCCESS if so, and a field of the latest one is written.",
        attribute("topic", str, "The topic's name."),
        attribute("type_", str, "Its type, such as `sensor_msgs/msg/BatteryState`."),
        attribute(
            "field", str, "A field to write to `value`, such as `pose.position.x`; empty for none.", ""
        ),
        _VALUE,
        attribute(
            "max_age_sec",
            Seconds,
            "How old a message may be, seconds of the node's clock; by default 5, and any age with `transient_local`.",
            None,
        ),
        attribute(
            "qos",
            Literal["sensor_data", "reliable", "transient_local"],
            "`sensor_data`, `reliable`, or `transient_local` for what was published before.",
            "sensor_data",
        ),
        attribute(
            "waits",
            bool,
            "Whether it is RUNNING, instead of FAILURE, while there is no message.",
            default=False,
        ),
        uses=(Use.topic("{topic}"),),
        answers=(Answer("SUCCESS", "there"), Answer("FAILURE", "missing"), Answer("RUNNING", "waiting")),
        kind=Kind.ACTION,
    ),
    leaf_spec(
        f"{_HERE}:RosTransform",
        "Where is a frame in another one? SUCCESS if the transforms of `/tf` say so, and it is written; RUNNING while they do not.",
        attribute("target_frame", str, "The frame in which it is told, such as `map`."),
        attribute("source_frame", str, "The frame of which it is told, such as `base_link`."),
        attribute("max_age_sec", Seconds, "How old the transforms may be, seconds of the node's clock.", 5.0),
        attribute("timeout_sec", Seconds, "How long to wait for them, seconds; then FAILURE.", 5.0),
        *(output_port(axis, float, f"Where {axis} is written, metres.", None) for axis in "xyz"),
        output_port("yaw", float, "Where the turn about z is written, rad.", None),
        *(
            output_port(f"q{part}", float, f"Where the quaternion's {part} is written.", None)
            for part in "xyzw"
        ),
        answers=(Answer("SUCCESS", "known"), Answer("FAILURE", "unknown"), Answer("RUNNING", "waiting")),
        kind=Kind.ACTION,
    ),
)


def specs(version: str) -> Sequence[NodeSpec]:  # noqa: ARG001 - they are the same in each
    """Return the records of the leaves for a distribution of ROS 2."""
    return _SPECS
