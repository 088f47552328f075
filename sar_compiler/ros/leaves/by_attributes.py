"""Leaves that need no Python: what they call, and with what, stands in the tree. The palette `ros:jazzy` has them."""

import reprlib
from collections.abc import Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import yaml
from py_trees.common import Status

from sar_compiler.nodes.values import Seconds
from sar_compiler.ros.clock import Deadline, deadline_clock
from sar_compiler.ros.frames import FrameTree, Transform, frame_tree
from sar_compiler.ros.leaves.action_leaf import ActionLeaf
from sar_compiler.ros.leaves.client_leaf import ServiceLeaf
from sar_compiler.ros.leaves.goals import SUCCEEDED, describe_status
from sar_compiler.ros.leaves.leaf import LeafDefinitionError, RosLeaf, find_interface
from sar_compiler.ros.leaves.topic_leaf import TopicLeaf
from sar_compiler.ros.message_values import read_field
from sar_compiler.runtime.ports import Output
from sar_compiler.tree.guessing import did_you_mean, nearest

_MAX_AGE_SEC = 5.0
_LIBRARIES = "*__rosidl_typesupport_c*"
"""What rosidl has generated has such a library beside its Python."""


class RosService(ServiceLeaf):
    """Call a service: SUCCESS when it has answered, and has not said no.

    Args:
        service: The service's name.
        type_: Its type, such as `std_srvs/srv/SetBool`.
        request: The request's fields as YAML, without the braces around: `data: true`.
        success: A field of the answer that must be true; empty for none.
        field: A field of the answer to write to `value`, such as `location.x`.
        value: Where it is written.
        server_timeout_sec: How long to wait for a server, seconds.
        timeout_sec: How long to wait for the answer, seconds.
    """

    def __init__(  # noqa: PLR0913 - a file's attributes
        self,
        name: str,
        service: str,
        type_: str,
        *,
        request: str = "",
        success: str = "",
        field: str = "",
        value: Output[object] | None = None,
        server_timeout_sec: Seconds = 10.0,
        timeout_sec: Seconds = 5.0,
    ) -> None:
        super().__init__(name)
        self.service_name, self.service_type = service, type_
        self.server_timeout_sec, self.timeout_sec = server_timeout_sec, timeout_sec
        self._request, self._success, self._field, self._value = request, success, field, value or Output()

    def setup(self, **kwargs: Any) -> None:
        """Create the client of a type that is one of ROS's interfaces."""
        self.require_definition()
        super().setup(**kwargs)

    def require_definition(self) -> None:
        """Read the request once, and look for the fields of the answer."""
        interface = _interface_of(self.name, "srv", self.service_name, self.service_type)
        filled(self.name, interface.Request(), self._request)
        for field in filter(None, (self._success, self._field)):
            field_of(self.name, interface.Response(), field)

    def request(self) -> Any:
        """Return the request."""
        return filled(self.name, self.interface.Request(), self._request)

    def on_response(self, response: Any) -> Status:
        """Return SUCCESS unless the answer says no, and write its field."""
        if self._success and not field_of(self.name, response, self._success):
            said = getattr(response, "message", self._success)
            self.complain(f"'{self.name}': '{self.service_name}' says no: {said}")
            return Status.FAILURE
        if self._field:
            self._value.set(field_of(self.name, response, self._field))
        return Status.SUCCESS


class RosAction(ActionLeaf):
    """Send a goal to an action: RUNNING until it has ended, SUCCESS if it has succeeded.

    Args:
        action: The action's name.
        type_: Its type, such as `nav2_msgs/action/Wait`.
        goal: The goal's fields as YAML, without the braces around: `time: {sec: 5}`.
        field: A field of the result to write to `value`.
        value: Where it is written.
        server_timeout_sec: How long to wait for a server, seconds.
        acceptance_timeout_sec: How long to wait for the goal to be accepted, seconds.
    """

    def __init__(
        self,
        name: str,
        action: str,
        type_: str,
        *,
        goal: str = "",
        field: str = "",
        value: Output[object] | None = None,
        server_timeout_sec: Seconds = 10.0,
        acceptance_timeout_sec: Seconds = 5.0,
    ) -> None:
        super().__init__(name)
        self.action_name, self.action_type = action, type_
        self.server_timeout_sec, self.acceptance_timeout_sec = server_timeout_sec, acceptance_timeout_sec
        self._goal, self._field, self._value = goal, field, value or Output()

    def setup(self, **kwargs: Any) -> None:
        """Create the client of a type that is one of ROS's interfaces."""
        self.require_definition()
        super().setup(**kwargs)

    def require_definition(self) -> None:
        """Read the goal once, and look for the field of the result."""
        interface = _interface_of(self.name, "action", self.action_name, self.action_type)
        filled(self.name, interface.Goal(), self._goal)
        if self._field:
            field_of(self.name, interface.Result(), self._field)

    def goal(self) -> Any:
        """Return the goal."""
        return filled(self.name, self.interface.Goal(), self._goal)

    def on_result(self, status: int, result: Any) -> Status:
        """Return SUCCESS if the goal has succeeded, and write the result's field."""
        if status != SUCCEEDED:
            return self.on_failure(f"'{self.action_name}': {describe_status(status)}")
        if self._field:
            self._value.set(field_of(self.name, result, self._field))
        return Status.SUCCESS


class RosTopic(TopicLeaf):
    """Is there a message of a topic? SUCCESS if so, and a field of the latest one is written.

    Args:
        topic: The topic's name.
        type_: Its type, such as `sensor_msgs/msg/BatteryState`.
        field: A field to write to `value`, such as `pose.position.x`; empty for none.
        value: Where it is written.
        max_age_sec: How old a message may be, seconds of the node's clock; by default 5, and any age with `transient_local`.
        qos: `sensor_data`, `reliable`, or `transient_local` for what was published before.
        waits: Whether it is RUNNING, instead of FAILURE, while there is no message.
    """

    def __init__(
        self,
        name: str,
        topic: str,
        type_: str,
        *,
        field: str = "",
        value: Output[object] | None = None,
        max_age_sec: Seconds | None = None,
        qos: str = "sensor_data",
        waits: bool = False,
    ) -> None:
        super().__init__(name)
        self.topic_name, self.topic_type = topic, type_
        # What a publisher keeps for latecomers was sent once, however long ago, and still holds.
        is_limited = max_age_sec is None and qos != "transient_local"
        self.max_age_sec = _MAX_AGE_SEC if is_limited else max_age_sec
        self.qos, self.waits = qos, waits
        self._field, self._value = field, value or Output()

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to a topic of a type that is one of ROS's interfaces."""
        self.require_definition()
        super().setup(**kwargs)

    def require_definition(self) -> None:
        """Look for the field."""
        message = _interface_of(self.name, "msg", self.topic_name, self.topic_type)
        if self._field:
            field_of(self.name, message(), self._field)

    def check_message(self, message: Any) -> None:
        """Hold the field against the definition of the message."""
        if self._field:
            read_field(message, self._field)

    def on_message(self, message: Any) -> Status:
        """Return SUCCESS, and write the field."""
        if self._field:
            self._value.set(read_field(message, self._field))
        return Status.SUCCESS


class RosTransform(RosLeaf):
    """Where is a frame in another one? SUCCESS if the transforms of `/tf` say so, and it is written; RUNNING while they do not.

    Args:
        target_frame: The frame in which it is told, such as `map`.
        source_frame: The frame of which it is told, such as `base_link`.
        max_age_sec: How old the transforms may be, seconds of the node's clock.
        timeout_sec: How long to wait for them, seconds; then FAILURE.
        x: Where x is written, metres.
        y: Where y is written, metres.
        z: Where z is written, metres.
        yaw: Where the turn about z is written, rad.
        qx: Where the quaternion's x is written.
        qy: Where the quaternion's y is written.
        qz: Where the quaternion's z is written.
        qw: Where the quaternion's w is written.
    """

    def __init__(  # noqa: PLR0913 - a file's attributes
        self,
        name: str,
        target_frame: str,
        source_frame: str,
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
        self._target, self._source = target_frame, source_frame
        written = {"x": x, "y": y, "z": z, "yaw": yaw, "qx": qx, "qy": qy, "qz": qz, "qw": qw}
        self._written = {part: output for part, output in written.items() if output is not None}
        self._frames: FrameTree | None = None
        self._deadline = Deadline(timeout_sec)

    def setup(self, **kwargs: Any) -> None:
        """Listen to transforms from now on, whatever is ticked.

        Args:
            **kwargs: `node` and optionally `wake`, see `RosLeaf`.
        """
        self.shutdown()
        super().setup(**kwargs)
        self._frames = frame_tree(self.node)
        self._frames.listen(self._on_transforms)

    def initialise(self) -> None:
        """Wait from now on."""
        self._deadline = Deadline(self.timeout_sec, deadline_clock(self.node))

    def update(self) -> Status:
        """Return SUCCESS, and write what is asked for, if the transforms are there and new enough."""
        found = self._look_up()
        if isinstance(found, Transform):
            self.feedback_message = ""
            for part, output in self._written.items():
                output.set(getattr(found, part))
            return Status.SUCCESS
        self.feedback_message = found
        if not self._deadline.passed:
            return Status.RUNNING
        where = f"where '{self._source}' is in '{self._target}' is not known"
        self.complain(f"'{self.name}': {where} within {self.timeout_sec:g} s: {found}")
        return Status.FAILURE

    def shutdown(self) -> None:
        """Listen no longer."""
        if self._frames is not None:
            self._frames.withdraw(self._on_transforms)
            self._frames = None
        super().shutdown()

    def _look_up(self) -> Transform | str:
        """Return where the frame is; in words why that is not known, if it is not."""
        found = frame_tree(self.node).look_up(self._target, self._source, self.max_age_sec)
        return found if isinstance(found, str) else found.transform

    def _on_transforms(self) -> None:
        if self.status is Status.RUNNING and isinstance(self._look_up(), Transform):
            self._wake()


def _interface_of(owner: str, kind: str, name: str, written: str) -> Any:
    """Return the class of a type that a file names."""
    require_interfaces(owner, written)
    return find_interface(owner, kind, name, written)


def require_interfaces(owner: str, written: str) -> None:
    """Check that a type that a file names is one of ROS's interfaces: of nothing else a module is imported.

    Args:
        owner: The leaf, for messages.
        written: The type, such as `std_srvs/srv/Trigger`.

    Raises:
        LeafDefinitionError: If its package is not installed, or was not generated by rosidl.
    """
    package = written.partition("/")[0]
    spec = None
    with suppress(ImportError, ValueError):  # `__main__` has none
        spec = find_spec(package) if package.isidentifier() else None
    folders = [Path(folder) for folder in (spec.submodule_search_locations or ())] if spec is not None else []
    if not any(library for folder in folders for library in folder.glob(f"{package}_s{_LIBRARIES}")):
        raise LeafDefinitionError(
            f"'{owner}': no package of interfaces is called '{package}'; write the type as package/kind/Name, "
            "such as std_srvs/srv/Trigger, and source its workspace"
        )


def filled(owner: str, message: Any, text: str) -> Any:
    """Return a message with the fields that a YAML text gives: `data: true, speed: 2`.

    Raises:
        LeafDefinitionError: If the text is no mapping, or a field is not there, or of another type.
    """
    try:
        # In a tree file braces around a whole value are a key.
        fields = yaml.safe_load(text if text.startswith("{") else f"{{{text}}}")
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise LeafDefinitionError(f"'{owner}': {text!r:.80} is no YAML: {error}") from error
    _fill(owner, message, fields, "")
    return message


def _fill(owner: str, message: Any, fields: Any, path: str) -> None:
    kinds = message.get_fields_and_field_types()
    # From Jazzy on messages look at the types of their fields only where they are told to.
    if hasattr(message, "_check_fields"):
        message._check_fields = True
    if not isinstance(fields, Mapping):
        raise LeafDefinitionError(
            f"'{owner}': {path or 'this'} must be fields, such as {{{next(iter(kinds), '')}: ...}}"
        )
    for name, value in fields.items():
        where = f"{path}.{name}" if path else str(name)
        if name not in kinds:
            raise LeafDefinitionError(
                f"'{owner}': there is no field '{where}'{did_you_mean(nearest(str(name), kinds))}"
            )
        inner = getattr(message, name)
        if hasattr(inner, "get_fields_and_field_types"):
            _fill(owner, inner, value, where)
            continue
        is_whole = isinstance(value, int) and not isinstance(value, bool)
        try:
            setattr(message, name, float(value) if is_whole and kinds[name] in ("double", "float") else value)
        except (AssertionError, TypeError, ValueError, OverflowError) as error:
            raise LeafDefinitionError(
                f"'{owner}': {where} is {reprlib.repr(value)}, and must be {kinds[name]}"
            ) from error


def field_of(owner: str, message: Any, path: str) -> object:
    """Return a field of a message by its path, such as `pose.position.x`, as a plain value.

    Raises:
        LeafDefinitionError: If there is no such field, or it is a message of its own.
    """
    value = message
    for name in path.split("."):
        kinds = value.get_fields_and_field_types() if hasattr(value, "get_fields_and_field_types") else {}
        if name not in kinds:
            raise LeafDefinitionError(
                f"'{owner}': there is no field '{path}'{did_you_mean(nearest(name, kinds))}"
            )
        value = getattr(value, name)
    if hasattr(value, "get_fields_and_field_types"):
        inner = next(iter(value.get_fields_and_field_types()), "")
        raise LeafDefinitionError(
            f"'{owner}': '{path}' has fields of its own: write one of them, such as {path}.{inner}"
        )
    return value.tolist() if hasattr(value, "tolist") else value
