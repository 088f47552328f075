"""Leaves that need no Python code: attributes in the tree file define the server or topic and the values."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from py_trees.common import Status

from sar_compiler.nodes.ros_fields import (
    Destinations,
    FieldPath,
    MessageFields,
    MessageReference,
    keys_of,
    read_fields,
    value_of,
)
from sar_compiler.nodes.ros_interfaces import (
    InterfaceError,
    MessageFiller,
    check_path,
    full_type,
    generated_type,
    reported_error,
)
from sar_compiler.nodes.values import ConversionError, Seconds
from sar_compiler.ros.clock import Deadline, deadline_clock
from sar_compiler.ros.frames import FrameTree, Transform, frame_tree
from sar_compiler.ros.graph_queries import Endpoint, explain_endpoint
from sar_compiler.ros.leaves.action_leaf import ActionLeaf
from sar_compiler.ros.leaves.client_leaf import ServiceLeaf
from sar_compiler.ros.leaves.goals import ABORTED, CANCELED, SUCCEEDED, ActionPort, describe_status
from sar_compiler.ros.leaves.leaf import LeafDefinitionError, RosLeaf, is_node_valid, of_node, qos_profile
from sar_compiler.ros.leaves.topic_leaf import TopicLeaf
from sar_compiler.ros.message_values import UnusableValueError, read_field
from sar_compiler.runtime.blackboard import Board, Scope
from sar_compiler.runtime.ports import Input, Output, PortError

_MAX_AGE_SEC = 5.0
_FLUSH_SEC = 0.5
"""The maximum wait at the end of a run until subscribers have acknowledged all messages, in seconds."""


class _OutgoingFields:
    """The fields of an outgoing message. A field's value may be a blackboard key.

    Args:
        leaf: The leaf that sends the message.
        attribute: The name of the attribute that contains the fields, for error messages.
        port: The fields, or a key whose value is a message, a mapping, or a string with fields; None for no fields.
        scope: The blackboard scope in which keys are resolved.
    """

    def __init__(self, leaf: RosLeaf, attribute: str, port: Input[object] | None, scope: Scope) -> None:
        port = port or Input(MessageFields({}))
        self._leaf, self._attribute, self._port, self._scope = leaf, attribute, port, scope
        constant = None if port.entry is not None else port.get()
        self._fields = read_fields(constant) if isinstance(constant, str) else constant
        for key in keys_of(self._fields) if isinstance(self._fields, MessageFields) else ():
            scope.resolve(key).declare()

    def check(self, cls: Any) -> None:
        """Check that the fields in the tree file match the message's class.

        Raises:
            InterfaceError: If a field does not exist, or a value does not fit.
        """
        if isinstance(self._fields, MessageFields):
            MessageFiller().fill(cls(), self._fields)

    def message(self, cls: Any) -> Any:
        """Create a message with the current values of the keys.

        Raises:
            PortError: If a key has no value, or a value does not fit the message.
        """
        source = f"{{{self._port.entry.key}}}" if self._port.entry is not None else ""
        try:
            found = self._fields if self._port.entry is None else self._field_value(self._port.get())
            if isinstance(found, MessageReference) and isinstance(found.message, cls):
                return found.message
            if not isinstance(found, MessageFields):
                raise InterfaceError(f"the value contains no fields of {cls.__name__}")  # noqa: TRY301 - converted like the errors of `fill`
            return MessageFiller(self._read_key, self._now).fill(cls(), found)
        except (InterfaceError, ConversionError) as error:
            message = f"{self._attribute}: {source and f'{source}: '}{error}"
            raise PortError(message, self._attribute, source.strip("{}")) from error

    @staticmethod
    def _field_value(value: object) -> object:
        return read_fields(value) if isinstance(value, str) else value_of(value)

    def _read_key(self, key: str) -> object:
        return Input[object](self._scope.resolve(key), name=self._attribute).get()

    def _now(self) -> tuple[int, int]:
        seconds, nanoseconds = self._leaf.node.get_clock().now().seconds_nanoseconds()
        return int(seconds), int(nanoseconds)


class _IncomingFields:
    """The fields of an incoming message that are written to blackboard keys.

    Args:
        scope: The blackboard scope in which the keys of *fields* are resolved.
        fields: The fields, each with its key; None for no fields.
        field: The field to write to *value*; None for the whole message.
        value: The output port for *field*; None to write only *fields*.
    """

    def __init__(
        self,
        scope: Scope,
        fields: Destinations | None,
        field: FieldPath | None = None,
        value: Output[object] | None = None,
    ) -> None:
        self._field = field
        self._outputs: list[tuple[FieldPath | None, Output[object]]] = []
        for path, key in fields.keys if fields is not None else ():
            entry = scope.resolve(key)
            entry.declare()
            self._outputs.append((path, Output(entry)))
        if value is not None:
            self._outputs.append((field, value))

    def __bool__(self) -> bool:
        """Return whether a field is written to a key."""
        return bool(self._outputs)

    def check(self, cls: Any) -> None:
        """Check that the message's class has the fields.

        Raises:
            InterfaceError: If a field does not exist.
        """
        for path in (self._field, *(path for path, _ in self._outputs)):
            if path is not None:
                check_path(cls, path)

    def require_usable(self, message: Any) -> None:
        """Check that the values of the fields in a message conform to the message's definition.

        Raises:
            UnusableValueError: If a value violates the definition.
        """
        for path, _ in self._outputs:
            if path is not None:
                with suppress(InterfaceError):  # `write` reports that a list has no such element
                    read_field(message, path.text)

    def write(self, message: Any) -> str:
        """Write the fields of a message to their keys; return the first error, or '' if there is none."""
        missing = ""
        for path, output in self._outputs:
            try:
                output.set(message if path is None else read_field(message, path.text))
            except (InterfaceError, UnusableValueError) as error:  # noqa: PERF203 - the remaining fields must still be written
                missing = missing or str(error)
        return missing


class _GraphName:
    """The name of a server or topic: a constant, or the value that a key has when the leaf starts.

    Args:
        port: The input port with the name.
        attribute: The name of the attribute that contains the name, for error messages.
    """

    def __init__(self, port: Input[str], attribute: str) -> None:
        self._port, self._attribute = port, attribute

    @property
    def current_name(self) -> str:
        """The constant name, or the current value of the key; empty if the key has no value yet."""
        return str(self._port.get("")) if self._port.entry is not None else self._port.get()

    @property
    def is_fixed(self) -> bool:
        """Whether the tree file contains the name itself, and not a key."""
        return self._port.entry is None

    @property
    def display_name(self) -> str:
        """The current name, or the key in braces if the key has no value yet."""
        return self.current_name or (f"{{{self._port.entry.key}}}" if self._port.entry is not None else "")

    def read_name(self) -> str:
        """Return the name of the server or topic. If the tree file contains a key, read the name from the key.

        Raises:
            PortError: If the key has no value, or its value is not a valid name.
        """
        name = self._port.get()
        if self._port.entry is not None:
            reason = _name_error(name)
            if reason:
                source = self._port.entry.key
                raise PortError(f"{self._attribute}: {{{source}}}: {reason}", self._attribute, source)
        return name


def _name_error(name: object) -> str:
    """Return why a value is not a valid name of a server or topic, or '' if the value is a valid name."""
    from rclpy.exceptions import NameValidationException
    from rclpy.validate_topic_name import validate_topic_name

    if not name or not isinstance(name, str):
        return f"{name!r} is not a valid server or topic name"
    try:
        validate_topic_name(name)
    except NameValidationException as error:
        reason = str(error).partition(":\n")[0].rpartition(": ")[2]
        return f"'{name}' is not a valid server or topic name: {reason}"
    return ""


def _load_type(kind: str, name: _GraphName, written: str) -> Any:
    """Return the Python class of a leaf's interface type, and check the server or topic name if it is a constant."""
    objection = name.is_fixed and _name_error(name.current_name)
    if objection:
        raise InterfaceError(objection)
    return generated_type(kind, written)


@contextmanager
def _definition_of(leaf: RosLeaf) -> Iterator[None]:
    """Convert errors in a leaf's attributes to a `LeafDefinitionError`."""
    try:
        yield
    except InterfaceError as error:
        raise LeafDefinitionError(f"'{leaf.name}': {error}") from error


class RosService(ServiceLeaf):
    """Call a service. Return SUCCESS when a response has arrived that does not report a failure.

    Args:
        service: The service's name.
        type_: The service's type, such as `std_srvs/srv/SetBool`.
        request: The request's fields as YAML, such as `data: true`; a value `{key}` stands for the value of the blackboard key.
        success: The field of the response that must be true for SUCCESS; empty if no field is checked.
        field: The field of the response to write to `value`, such as `location.x`; empty for the whole response.
        value: The blackboard key to which `field` is written.
        fields: Further fields of the response, each with its key: `x: {x}, y: {y}`.
        server_timeout_sec: The maximum wait for a server, in seconds.
        timeout_sec: The maximum wait for the response, in seconds.
        scope: The blackboard scope in which keys are resolved.
    """

    def __init__(  # noqa: PLR0913 - a file's attributes
        self,
        name: str,
        service: Input[str],
        type_: str,
        *,
        request: Input[object] | None = None,
        success: FieldPath | None = None,
        field: FieldPath | None = None,
        value: Output[object] | None = None,
        fields: Destinations | None = None,
        server_timeout_sec: Seconds = 10.0,
        timeout_sec: Seconds = 5.0,
        scope: Scope | None = None,
    ) -> None:
        super().__init__(name)
        scope = scope or Scope(Board(name))
        self._name = _GraphName(service, "service")
        self.service_name, self.service_type = self._name.current_name, full_type("srv", type_)
        self.server_timeout_sec, self.timeout_sec = server_timeout_sec, timeout_sec
        self._success = success
        self._sent = _OutgoingFields(self, "request", request, scope)
        self._received = _IncomingFields(scope, fields, field, value)

    def setup(self, **kwargs: Any) -> None:
        """Check the leaf's attributes, and create the client if the service's name is known."""
        self.require_definition()
        super().setup(**kwargs)

    def require_definition(self) -> None:
        """Check the service's type, the request, and the fields of the response."""
        with _definition_of(self):
            interface = _load_type("srv", self._name, self.service_type)
            self._sent.check(interface.Request)
            self._received.check(interface.Response)
            if self._success:
                check_path(interface.Response, self._success)

    def initialise(self) -> None:
        """Call the service. If the service's name is a key, use the key's current value."""
        name = self._name.read_name()
        if name != self.service_name:
            self._drop()
            self._disconnect()
            self.service_name = name
            self._connect()
        super().initialise()

    def _server(self) -> tuple[str, str, Any]:
        return "srv", self.service_name or self._name.display_name, self.service_type

    def _connect(self) -> None:
        if self.service_name:
            super()._connect()

    def request(self) -> Any:
        """Return the request with the current values of the keys."""
        return self._sent.message(self.interface.Request)

    def on_failure(self, reason: str) -> Status:
        """Return FAILURE, because there is no response."""
        return self.outcome(super().on_failure(reason), "no answer")

    def on_response(self, response: Any) -> Status:
        """Write the response's fields. Return SUCCESS unless the response reports a failure or lacks a field."""
        missing = self._received.write(response)
        if self._success and not self._is_true(response, self._success):
            reason = _failure_reason(response, self._success) or str(self._success)
            self.warn(f"'{self.name}': '{self.service_name}' reports a failure: {reason}")
            return self.outcome(Status.FAILURE, "refused")
        if missing:
            return self.on_failure(missing)
        return self.outcome(Status.SUCCESS, "answered")

    @staticmethod
    def _is_true(response: Any, field: FieldPath) -> bool:
        try:
            return bool(read_field(response, field.text))
        except InterfaceError:
            return False


def _failure_reason(response: Any, field: FieldPath) -> str:
    """Return the error text in a response, preferably the text next to the field that is false."""
    parent, dot, _ = field.text.rpartition(".")
    reason = ""
    if dot:
        try:
            reason = reported_error(read_field(response, parent))
        except InterfaceError as error:
            reason = str(error)
    return reason or reported_error(response)


class RosAction(ActionLeaf):
    """Send a goal to an action. Return RUNNING until the goal has ended, and SUCCESS if the goal has succeeded.

    The fields of the result are written even if the goal was aborted or cancelled.

    Args:
        action: The action's name.
        type_: The action's type, such as `nav2_msgs/action/Wait`.
        goal: The goal's fields as YAML, such as `time: {sec: 5}`; a value `{key}` stands for the value of the blackboard key.
        field: The field of the result to write to `value`; empty for the whole result.
        value: The blackboard key to which `field` is written.
        fields: Further fields of the result, each with its key: `error_code: {code}, error_msg: {text}`.
        feedback: The fields of the feedback to write in each tick, each with its key: `distance_remaining: {left}`.
        server_timeout_sec: The maximum wait for a server, in seconds.
        acceptance_timeout_sec: The maximum wait for the acceptance of the goal, in seconds.
        scope: The blackboard scope in which keys are resolved.
    """

    def __init__(  # noqa: PLR0913 - a file's attributes
        self,
        name: str,
        action: Input[str],
        type_: str,
        *,
        goal: Input[object] | None = None,
        field: FieldPath | None = None,
        value: Output[object] | None = None,
        fields: Destinations | None = None,
        feedback: Destinations | None = None,
        server_timeout_sec: Seconds = 10.0,
        acceptance_timeout_sec: Seconds = 5.0,
        scope: Scope | None = None,
    ) -> None:
        super().__init__(name)
        scope = scope or Scope(Board(name))
        self._name = _GraphName(action, "action")
        self.action_name, self.action_type = self._name.current_name, full_type("action", type_)
        self.server_timeout_sec, self.acceptance_timeout_sec = server_timeout_sec, acceptance_timeout_sec
        self._sent = _OutgoingFields(self, "goal", goal, scope)
        self._received = _IncomingFields(scope, fields, field, value)
        self._feedback = _IncomingFields(scope, feedback)
        self._former_ports: dict[str, ActionPort] = {}

    def setup(self, **kwargs: Any) -> None:
        """Check the leaf's attributes, and create the client if the action's name is known."""
        self.require_definition()
        super().setup(**kwargs)

    def require_definition(self) -> None:
        """Check the action's type, the goal, and the fields of the result and the feedback."""
        with _definition_of(self):
            interface = _load_type("action", self._name, self.action_type)
            self._sent.check(interface.Goal)
            self._received.check(interface.Result)
            self._feedback.check(interface.Feedback)

    def initialise(self) -> None:
        """Send the goal. If the action's name is a key, use the key's current value."""
        name = self._name.read_name()
        if name != self.action_name:
            self._drop()
            if self._port is not None:
                # The client is kept, because a goal of this server may still be active.
                self._former_ports[self.action_name] = self._port
            self.action_name = name
            self._port = self._former_ports.pop(name, None)
            if self._port is None:
                self._connect()
        super().initialise()

    def shutdown(self) -> None:
        """Cancel an active goal, and release the clients of all servers."""
        self._drop()
        if self.is_settled():
            for port in self._former_ports.values():
                port.release()
        self._former_ports = {}
        super().shutdown()

    def _server(self) -> tuple[str, str, Any]:
        return "action", self.action_name or self._name.display_name, self.action_type

    def _connect(self) -> None:
        if self.action_name:
            super()._connect()

    def goal(self) -> Any:
        """Return the goal with the current values of the keys."""
        return self._sent.message(self.interface.Goal)

    def on_feedback(self, feedback: Any) -> None:
        """Write the fields of the feedback to their keys."""
        self._feedback.write(feedback)

    def on_failure(self, reason: str) -> Status:
        """Return FAILURE, because there is no result."""
        return self.outcome(super().on_failure(reason), "no result")

    def on_unavailable(self, reason: str) -> Status:
        """Return FAILURE. If the goal has succeeded although the robot has not arrived, write the fields of the result."""
        failed, goal = super().on_unavailable(reason), self._exchange
        if (
            goal is None
            or goal.answer is None
            or goal.is_result_lost
            or self._received.write(goal.answer.result)
        ):
            return failed
        return self.outcome(failed, "aborted")

    def on_result(self, status: int, result: Any) -> Status:
        """Write the fields of the result, if a result has arrived. Return SUCCESS if the goal has succeeded."""
        is_lost = self._exchange is not None and self._exchange.is_result_lost
        has_result = status in (SUCCEEDED, ABORTED, CANCELED) and not is_lost
        missing = (
            self._received.write(result)
            if has_result
            else "the goal's result is lost"
            if self._received
            else ""
        )
        if status == SUCCEEDED:
            return self.on_failure(missing) if missing else self.outcome(Status.SUCCESS, "succeeded")
        reason = describe_status(status, result if has_result else None)
        failed = self.on_failure(f"'{self.action_name}': {reason}")
        return self.outcome(failed, "aborted" if has_result and not missing else "no result")


class RosTopic(TopicLeaf):
    """Check for a message on a topic. If there is a message, write its fields to keys and return SUCCESS.

    Args:
        topic: The topic's name.
        type_: The topic's type, such as `sensor_msgs/msg/BatteryState`.
        field: The field to write to `value`, such as `pose.position.x`; empty for the whole message.
        value: The blackboard key to which `field` is written.
        fields: Further fields, each with its key: `pose.position.x: {x}`.
        max_age_sec: The maximum age of a message, in seconds of the node's clock; 5 by default, unlimited with
            `transient_local`.
        qos: The QoS profile: `sensor_data`, `reliable`, or `transient_local` to receive messages that were published earlier.
        waits: Whether the leaf returns RUNNING, instead of FAILURE, while there is no message.
        scope: The blackboard scope in which keys are resolved.
    """

    def __init__(  # noqa: PLR0913 - a file's attributes
        self,
        name: str,
        topic: Input[str],
        type_: str,
        *,
        field: FieldPath | None = None,
        value: Output[object] | None = None,
        fields: Destinations | None = None,
        max_age_sec: Seconds | None = None,
        qos: str = "sensor_data",
        waits: bool = False,
        scope: Scope | None = None,
    ) -> None:
        super().__init__(name)
        self._name = _GraphName(topic, "topic")
        self.topic_name, self.topic_type = self._name.current_name, full_type("msg", type_)
        # A `transient_local` message is sent once, and is valid at any age.
        is_limited = max_age_sec is None and qos != "transient_local"
        self.max_age_sec = _MAX_AGE_SEC if is_limited else max_age_sec
        self.qos, self.waits = qos, waits
        self._received = _IncomingFields(scope or Scope(Board(name)), fields, field, value)

    def setup(self, **kwargs: Any) -> None:
        """Check the leaf's attributes, and subscribe to the topic if its name is known."""
        self.require_definition()
        super().setup(**kwargs)

    def require_definition(self) -> None:
        """Check the topic's type and the fields."""
        with _definition_of(self):
            self._received.check(_load_type("msg", self._name, self.topic_type))

    def initialise(self) -> None:
        """Subscribe to the topic. If the topic's name is a key, use the key's current value."""
        name = self._name.read_name()
        if name != self.topic_name:
            self.topic_name = name
            self.subscribe()
        super().initialise()

    def subscribe(self) -> None:
        """Subscribe to the topic if its name is already known."""
        if self.topic_name:
            super().subscribe()

    def check_message(self, message: Any) -> None:
        """Check that the values of the fields conform to the message's definition."""
        self._received.require_usable(message)

    def on_message(self, message: Any) -> Status:
        """Write the fields to their keys; return SUCCESS, or FAILURE if a field cannot be written."""
        missing = self._received.write(message)
        if missing:
            self.warn(f"'{self.name}': {missing}")
            return Status.FAILURE
        return Status.SUCCESS


class RosPublish(RosLeaf):
    """Publish a message. Return RUNNING until a subscriber is present, and SUCCESS when the message has been sent.

    Args:
        topic: The topic's name.
        type_: The topic's type, such as `std_msgs/msg/String`.
        message: The message's fields as YAML, such as `data: hello`; a value `{key}` stands for the value of the blackboard key.
        qos: The QoS profile: `reliable`, `sensor_data`, or `transient_local` to also reach later subscribers.
        waits: Whether the leaf returns RUNNING until there is a subscriber. With `transient_local`, it never waits.
        timeout_sec: The maximum wait for a subscriber, in seconds, after which the leaf returns FAILURE.
        scope: The blackboard scope in which keys are resolved.
    """

    def __init__(
        self,
        name: str,
        topic: Input[str],
        type_: str,
        *,
        message: Input[object] | None = None,
        qos: str = "reliable",
        waits: bool = True,
        timeout_sec: Seconds = 5.0,
        scope: Scope | None = None,
    ) -> None:
        super().__init__(name)
        self._name = _GraphName(topic, "topic")
        self._type, self._qos, self.timeout_sec = full_type("msg", type_), qos, timeout_sec
        self._waits = waits and qos != "transient_local"
        self._sent = _OutgoingFields(self, "message", message, scope or Scope(Board(name)))
        self._publisher: Any = None
        self._deadline = Deadline(timeout_sec)

    def setup(self, **kwargs: Any) -> None:
        """Create the publisher early if the topic's name is known, so that subscribers can discover the publisher.

        Args:
            **kwargs: `node`, and optionally `wake` (see `RosLeaf`).
        """
        self.require_definition()
        self.shutdown()
        super().setup(**kwargs)
        if self._name.current_name:
            self._publisher = self._publisher_of(self._name.current_name)

    def require_definition(self) -> None:
        """Check the topic's type and the message."""
        with _definition_of(self):
            self._sent.check(_load_type("msg", self._name, self._type))

    def initialise(self) -> None:
        """Create the publisher if necessary, and start the timeout.

        If the topic's name is a key, the key's value is read now.
        """
        self._publisher = self._publisher_of(self._name.read_name())
        self._deadline = Deadline(self.timeout_sec, deadline_clock(self.node))

    def update(self) -> Status:
        """Publish the message, or return RUNNING if the leaf must wait for a subscriber."""
        topic = self._publisher.topic_name
        if self._waits and not self._publisher.get_subscription_count():
            self.feedback_message = f"waiting for a subscriber of '{topic}'"
            if not self._deadline.has_passed:
                return Status.RUNNING
            qos = qos_profile(self.name, self._qos)
            why = explain_endpoint(self.node, Endpoint("listeners", topic, self._type, (qos,), "topic"))
            self.warn(f"'{self.name}': no subscriber of '{topic}' within {self.timeout_sec:g} s{why}")
            return Status.FAILURE
        self._publisher.publish(self._sent.message(self._publisher.msg_type))
        self.feedback_message = ""
        return Status.SUCCESS

    def shutdown(self) -> None:
        """Wait briefly until subscribers have acknowledged the messages.

        The publisher is not destroyed, because other leaves may use it.
        """
        from rclpy.duration import Duration

        if self._publisher is not None and is_node_valid(self.node):
            self._publisher.wait_for_all_acked(Duration(seconds=_FLUSH_SEC))
        self._publisher = None
        super().shutdown()

    def _publisher_of(self, topic: str) -> Any:
        """Return the node's publisher of a topic. All leaves with the same type and QoS profile share this publisher."""
        kind = generated_type("msg", self._type)
        qos = qos_profile(type(self).__name__, self._qos)
        qos.depth = 1 if self._qos == "transient_local" else _DEPTH
        key = RosPublish, topic, kind, self._qos
        return of_node(self.node, key, lambda: self.node.create_publisher(kind, topic, qos))


_DEPTH = 10
"""The number of messages that are queued for slow subscribers, as in `ros2 topic pub`."""


class RosTransform(RosLeaf):
    """Look up the pose of a frame in another frame. Return RUNNING until the pose is known, and then SUCCESS.

    Args:
        target_frame: The outer frame, such as `map`, in which the pose is expressed.
        source_frame: The inner frame, such as `base_link`, whose pose is looked up.
        max_age_sec: The maximum age of the transforms, in seconds of the node's clock.
        timeout_sec: The maximum wait for the transforms, in seconds, after which the leaf returns FAILURE.
        x: The key for the position's x, in metres.
        y: The key for the position's y, in metres.
        z: The key for the position's z, in metres.
        yaw: The key for the rotation about the z axis, in radians.
        qx: The key for the x component of the rotation's quaternion.
        qy: The key for the y component of the quaternion.
        qz: The key for the z component of the quaternion.
        qw: The key for the scalar component of the quaternion.
    """

    def __init__(  # noqa: PLR0913 - a file's attributes
        self,
        name: str,
        target_frame: Input[str],
        source_frame: Input[str],
        *,
        max_age_sec: Seconds = 5.0,
        timeout_sec: Seconds = 5.0,
        x: Output[float] | None = None,
        y: Output[float] | None = None,
        z: Output[float] | None = None,
        yaw: Output[float] | None = None,
        qx: Output[float] | None = None,
        qy: Output[float] | None = None,
        qz: Output[float] | None = None,
        qw: Output[float] | None = None,
    ) -> None:
        super().__init__(name)
        self.max_age_sec, self.timeout_sec = max_age_sec, timeout_sec
        self._frame_ports = target_frame, source_frame
        self._target = self._source = ""
        written = {"x": x, "y": y, "z": z, "yaw": yaw, "qx": qx, "qy": qy, "qz": qz, "qw": qw}
        self._written = {part: output for part, output in written.items() if output is not None}
        self._frames: FrameTree | None = None
        self._deadline = Deadline(timeout_sec)

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to transforms, so that they are received before the leaf is ticked.

        Args:
            **kwargs: `node`, and optionally `wake` (see `RosLeaf`).
        """
        self.shutdown()
        super().setup(**kwargs)
        self._frames = frame_tree(self.node)
        self._frames.add_listener(self._on_transforms)

    def initialise(self) -> None:
        """Read the names of the frames from the ports, and start the timeout."""
        self._target, self._source = (port.get() for port in self._frame_ports)
        self._deadline = Deadline(self.timeout_sec, deadline_clock(self.node))

    def update(self) -> Status:
        """Write the pose and return SUCCESS if the pose is known; otherwise return RUNNING, or FAILURE after the timeout."""
        found = self._look_up()
        if isinstance(found, Transform):
            self.feedback_message = ""
            for part, output in self._written.items():
                output.set(getattr(found, part))
            return Status.SUCCESS
        self.feedback_message = found
        if not self._deadline.has_passed:
            return Status.RUNNING
        problem = (
            f"the pose of '{self._source}' in '{self._target}' is still unknown after {self.timeout_sec:g} s"
        )
        self.warn(f"'{self.name}': {problem}: {found}")
        return Status.FAILURE

    def shutdown(self) -> None:
        """Stop listening to transforms."""
        if self._frames is not None:
            self._frames.remove_listener(self._on_transforms)
            self._frames = None
        super().shutdown()

    def _look_up(self) -> Transform | str:
        """Return the pose of the source frame in the target frame, or the reason why it is unknown."""
        found = frame_tree(self.node).look_up(self._target, self._source, self.max_age_sec)
        return found if isinstance(found, str) else found.transform

    def _on_transforms(self) -> None:
        if self.status is Status.RUNNING and isinstance(self._look_up(), Transform):
            self._wake()
