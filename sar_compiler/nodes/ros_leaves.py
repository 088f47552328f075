"""Specs of leaves for any ROS action, service or topic (`--model ros:jazzy`).

The leaves need no Python code.
"""

from collections.abc import Callable, Sequence
from typing import Any, Literal

from sar_compiler.nodes.collector import FindingCollector, NodeView
from sar_compiler.nodes.declaring import SCOPE, attribute, handed_over, input_port, leaf_spec, output_port
from sar_compiler.nodes.ros_fields import (
    DESTINATIONS,
    FIELD_PATH,
    FIELDS,
    Destinations,
    FieldPath,
    MessageFields,
)
from sar_compiler.nodes.ros_interfaces import (
    InterfaceError,
    MessageFiller,
    check_path,
    generated_type,
    is_ros_installed,
)
from sar_compiler.nodes.semantics import AccessKind, KeyRole, Semantics
from sar_compiler.nodes.spec import Kind, NodeSpec, Use
from sar_compiler.nodes.values import Seconds
from sar_compiler.runtime.outcomes import Outcome
from sar_compiler.tree.diagnostic import Advice, Severity, Span
from sar_compiler.tree.model import Element

VERSIONS = ("jazzy",)
_HERE = "sar_compiler.ros.leaves.attribute_leaves"
_WRITES = KeyRole(AccessKind.WRITE)
_SENDS = "The fields of the {0} as YAML: `{1}`. `{{key}}` inserts the value of a key. The attribute may also be a key whose value is the whole {0}."
_VALUE = output_port("value", object, "The key to which the value is written.", None)
_SERVER = attribute("server_timeout_sec", Seconds, "Time to wait for the server, in seconds.", 10.0)
_SCOPE = handed_over("scope", SCOPE.target_path, SCOPE.doc, required=False)
_RESULT = ("value", "fields")
_NEVER: tuple[str, ...] = ()


def _field(of: str, example: str) -> Any:
    doc = f"The field of the {of} to write to `value`, such as `{example}`; empty for the whole {of}."
    return attribute("field", FIELD_PATH, doc, None)


def _fields(keyword: str, of: str, example: str) -> Any:
    doc = f"The fields of the {of} to store, each with a key: `{example}`."
    return attribute(keyword, DESTINATIONS, doc, None)


def _check(kind: str, **parts: str) -> Callable[[NodeView, FindingCollector], None]:
    """Return a rule that checks a leaf's type, fields and values if ROS is installed.

    Args:
        kind: The kind of interface: `action`, `srv` or `msg`.
        **parts: The part of the interface (such as `Request`) for each attribute with fields; empty for the message itself.
    """

    def rule(bound: NodeView, collector: FindingCollector) -> None:
        written = bound.values.get("type")
        if not isinstance(written, str) or not is_ros_installed():
            return
        _check_value(bound, collector)
        try:
            interface = generated_type(kind, written)
        except InterfaceError as error:
            collector.add("unknown-interface", *_finding_arguments(bound, "type", error), **_advice(error))
            return
        for name, part in parts.items():
            wrong = _find_fields_error(
                bound.values.get(name), getattr(interface, part) if part else interface
            )
            if wrong is not None:
                collector.add("wrong-value", *_finding_arguments(bound, name, wrong), **_advice(wrong))

    return rule


def _find_fields_error(value: object, cls: Any) -> InterfaceError | None:
    """Return the error in an attribute with fields of a message class; None if the fields are valid."""
    try:
        if isinstance(value, MessageFields):
            MessageFiller().fill(cls(), value)
        elif isinstance(value, FieldPath):
            check_path(cls, value)
        elif isinstance(value, Destinations):
            for path, _ in value.keys:
                check_path(cls, path)
    except InterfaceError as error:
        return error
    return None


def _check_value(bound: NodeView, collector: FindingCollector) -> None:
    if bound.values.get("field") is not None and "value" not in bound.keys:
        message = "field: add the attribute 'value' with the key to which the field is written"
        collector.add("missing-attribute", message, bound.element, hint='write value="{key}"')


def _finding_arguments(bound: NodeView, name: str, error: InterfaceError) -> tuple[str, Element, Span]:
    """Return the message, the element and the location of a finding."""
    element, place = bound.element, error.place
    span = element.value_part_span(name, *place) if place else element.value_span(name)
    return f"{name}: {error.message}", element, span


def _advice(error: InterfaceError) -> Advice:
    about = Advice(suggestion=error.suggestion, hint=error.hint)
    if not error.is_certain:
        about["severity"] = Severity.WARNING
    return about


_SPECS = (
    leaf_spec(
        f"{_HERE}:RosService",
        "Calls a service. Returns SUCCESS if the service responds without reporting a failure.",
        input_port("service", str, "The service's name."),
        attribute("type_", str, "The service's type, such as `std_srvs/srv/SetBool`."),
        input_port("request", FIELDS, _SENDS.format("request", "data: true"), None),
        attribute(
            "success", FIELD_PATH, "The field of the response that must be true; empty for no check.", None
        ),
        _field("response", "location.x"),
        _VALUE,
        _fields("fields", "response", "location.x: {x}, location.y: {y}"),
        _SERVER,
        attribute("timeout_sec", Seconds, "Time to wait for the response, in seconds.", 5.0),
        _SCOPE,
        uses=(Use.service("{service}"),),
        effects="calls a service",
        outcomes=(
            Outcome("SUCCESS", "answered", writes=_RESULT),
            Outcome("FAILURE", "refused", writes=_RESULT),
            Outcome("FAILURE", "no answer", writes=_NEVER),
            Outcome("RUNNING", "calling", writes=_NEVER),
        ),
        semantics=Semantics(keys={"fields": _WRITES}),
        rule=_check("srv", request="Request", success="Response", field="Response", fields="Response"),
    ),
    leaf_spec(
        f"{_HERE}:RosAction",
        "Sends a goal to an action server. Returns RUNNING until the goal has ended, and SUCCESS if it has succeeded.",
        input_port("action", str, "The action's name."),
        attribute("type_", str, "The action's type, such as `nav2_msgs/action/Wait`."),
        input_port("goal", FIELDS, _SENDS.format("goal", "time: {sec: 5}"), None),
        _field("result", "error_code"),
        _VALUE,
        _fields("fields", "result", "error_code: {code}, error_msg: {text}"),
        _fields("feedback", "feedback", "distance_remaining: {left}"),
        _SERVER,
        attribute(
            "acceptance_timeout_sec", Seconds, "Time to wait for the goal to be accepted, in seconds.", 5.0
        ),
        _SCOPE,
        uses=(Use.action("{action}"),),
        effects="executes a goal",
        outcomes=(
            Outcome("SUCCESS", "succeeded", writes=_RESULT),
            Outcome("FAILURE", "aborted", writes=_RESULT),
            Outcome("FAILURE", "no result", writes=_NEVER),
            Outcome("RUNNING", "under way", writes=("feedback",)),
        ),
        semantics=Semantics(keys={"fields": _WRITES, "feedback": _WRITES}),
        rule=_check("action", goal="Goal", field="Result", fields="Result", feedback="Feedback"),
    ),
    leaf_spec(
        f"{_HERE}:RosTopic",
        "Checks for a message on a topic. Returns SUCCESS if there is a message, and stores fields of the latest message.",
        input_port("topic", str, "The topic's name."),
        attribute("type_", str, "The topic's type, such as `sensor_msgs/msg/BatteryState`."),
        _field("message", "pose.position.x"),
        _VALUE,
        _fields("fields", "message", "pose.position.x: {x}"),
        attribute(
            "max_age_sec",
            Seconds,
            "Maximum age of a message, in seconds of the node's clock. The default is 5, or unlimited with `transient_local`.",
            None,
        ),
        attribute(
            "qos",
            Literal["sensor_data", "reliable", "transient_local"],
            "The QoS: `sensor_data`, `reliable`, or `transient_local` to receive messages published earlier.",
            "sensor_data",
        ),
        attribute(
            "waits",
            bool,
            "If true, the leaf returns RUNNING while there is no message. If false, the leaf returns FAILURE instead.",
            default=False,
        ),
        _SCOPE,
        uses=(Use.topic("{topic}"),),
        outcomes=(
            Outcome("SUCCESS", "there", writes=_RESULT),
            Outcome("FAILURE", "missing", writes=_NEVER),
            Outcome("RUNNING", "waiting", writes=_NEVER),
        ),
        kind=Kind.ACTION,
        semantics=Semantics(keys={"fields": _WRITES}),
        rule=_check("msg", field="", fields=""),
    ),
    leaf_spec(
        f"{_HERE}:RosPublish",
        "Publishes a message. Returns RUNNING until there is a subscriber, SUCCESS when the message is sent, and FAILURE after `timeout_sec`.",
        input_port("topic", str, "The topic's name."),
        attribute("type_", str, "The topic's type, such as `std_msgs/msg/String`."),
        input_port("message", FIELDS, _SENDS.format("message", "data: hello"), None),
        attribute(
            "qos",
            Literal["reliable", "sensor_data", "transient_local"],
            "The QoS: `reliable`, `sensor_data`, or `transient_local` to reach later subscribers as well.",
            "reliable",
        ),
        attribute(
            "waits",
            bool,
            "Whether to return RUNNING until there is a subscriber. With `transient_local`, the leaf never waits.",
            default=True,
        ),
        attribute("timeout_sec", Seconds, "Maximum time to wait for a subscriber, in seconds.", 5.0),
        _SCOPE,
        effects="publishes a message",
        outcomes=(
            Outcome("SUCCESS", "published"),
            Outcome("FAILURE", "no subscriber"),
            Outcome("RUNNING", "waiting"),
        ),
        rule=_check("msg", message=""),
    ),
    leaf_spec(
        f"{_HERE}:RosTransform",
        "Looks up the pose of a frame in another frame. Returns SUCCESS if `/tf` contains the transforms, RUNNING while transforms are missing, and FAILURE after `timeout_sec`.",
        input_port("target_frame", str, "The reference frame, such as `map`."),
        input_port("source_frame", str, "The frame to locate, such as `base_link`."),
        attribute(
            "max_age_sec", Seconds, "Maximum age of the transforms, in seconds of the node's clock.", 5.0
        ),
        attribute("timeout_sec", Seconds, "Maximum time to wait for the transforms, in seconds.", 5.0),
        *(
            output_port(axis, float, f"The key to which the coordinate {axis} is written, in metres.", None)
            for axis in "xyz"
        ),
        output_port("yaw", float, "The key to which the rotation about z is written, in radians.", None),
        *(
            output_port(f"q{each}", float, f"The key to which the quaternion's {each} is written.", None)
            for each in "xyzw"
        ),
        uses=(Use.transforms(),),
        outcomes=(
            Outcome("SUCCESS", "known", writes=("x", "y", "z", "yaw", "qx", "qy", "qz", "qw")),
            Outcome("FAILURE", "unknown", writes=_NEVER),
            Outcome("RUNNING", "waiting", writes=_NEVER),
        ),
        kind=Kind.ACTION,
    ),
)


def specs(version: str) -> Sequence[NodeSpec]:  # noqa: ARG001 - the leaves are the same in each distribution
    """Return the specs of the leaves for a ROS 2 distribution."""
    return _SPECS
