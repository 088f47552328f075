"""Messages that are made of fields in a tree file: of every interface that is installed, and of twenty by hand."""

import itertools
import math
import pkgutil
from collections.abc import Iterator
from importlib import import_module
from typing import Any, ClassVar

import pytest

from sar_compiler.nodes.ros_fields import (
    FieldPath,
    KeyReference,
    keys_of,
    read_destinations,
    read_fields,
    read_path,
)
from sar_compiler.nodes.ros_interfaces import (
    InterfaceError,
    MessageFiller,
    check_path,
    fields_of,
    full_type,
    generated_type,
    integer_range,
    message_class,
    read_field,
    reported_error,
)
from sar_compiler.nodes.values import ConversionError

pytestmark = pytest.mark.ros
PARTS = {"msg": ("",), "srv": ("Request", "Response"), "action": ("Goal", "Result", "Feedback")}
NOW = (1_700_000_000, 5)
TEXT = "a, b: {c} [d] # é 'q' \"r\""


def interfaces(package: str) -> Iterator[tuple[str, str, Any]]:
    """Yield the kinds, the types and the classes of all interfaces of a package, which rosidl has generated or not."""
    for kind, parts in PARTS.items():
        try:
            module = import_module(f"{package}.{kind}")
        except ImportError:
            continue
        for name, each in vars(module).items():
            if isinstance(each, type) and all(hasattr(each, part) for part in parts if part):
                yield kind, f"{package}/{kind}/{name}", each


def is_generated(package: str) -> bool:
    from sar_compiler.nodes.ros_interfaces import require_generated

    try:
        require_generated(package)
    except InterfaceError:
        return False
    return True


PACKAGES = sorted(each.name for each in pkgutil.iter_modules() if each.ispkg and is_generated(each.name))


def classes(package: str) -> Iterator[Any]:
    for kind, written, _ in interfaces(package):
        found = generated_type(kind, written)
        for part in PARTS[kind]:
            yield getattr(found, part) if part else found


class Sample:
    """Values for all fields of a message: the largest, the smallest, texts that YAML could misread, lists of both."""

    NUMBERS = (("3", 3.0), ("-0.5", -0.5), ("1e3", 1000.0), (".inf", math.inf))
    OTHERS: ClassVar[dict[str, tuple[tuple[str, Any], ...]]] = {
        **dict.fromkeys(("float", "double", "long double"), NUMBERS),
        "boolean": (("true", True), ("0", False), ("1", True), ("'false'", False)),
        "octet": (("200", 200), ("0", 0)),
        "char": (("x", "x"),),
        "wchar": (("ü", "ü"),),
    }

    def __init__(self) -> None:
        self.turns = itertools.count()

    def single(self, base: str, length: int | None) -> tuple[str, Any]:
        """Return a value as a file writes it, and as it is read back."""
        turn = next(self.turns)
        whole = integer_range(base)
        if whole is not None:
            value = whole[-1] if turn % 2 else whole[0]
            return (f"{value}", value) if turn % 3 else (f"'{value}'", value)
        if base in self.OTHERS:
            return self.OTHERS[base][turn % len(self.OTHERS[base])]
        if base in ("string", "wstring"):
            if turn % 2 or length is not None:
                text = TEXT if length is None else "x" * length
                return f"'{text.replace(chr(39), chr(39) * 2)}'", text
            return "007", "007"
        return self.message(message_class(base))

    def message(self, cls: Any) -> tuple[str, dict[str, Any]]:
        texts, values = [], {}
        for name, kind in fields_of(cls).items():
            if kind.is_list:
                count = kind.size if kind.size is not None else min(2, kind.most or 2)
                several = [self.single(kind.base, kind.length) for _ in range(count)]
                text, values[name] = (
                    f"[{', '.join(each for each, _ in several)}]",
                    [each for _, each in several],
                )
            else:
                text, values[name] = self.single(kind.base, kind.length)
            texts.append(f"{name}: {text}")
        return f"{{{', '.join(texts)}}}", values


def plain(value: Any) -> Any:
    """Return all that is in a message, by a way of its own."""
    if hasattr(value, "get_fields_and_field_types"):
        names = [
            name
            for name in value.get_fields_and_field_types()
            if name != "structure_needs_at_least_one_member"
        ]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, bytes):
        return value[0]
    if isinstance(value, str) or not hasattr(value, "__len__"):
        return value
    return [plain(each) for each in value]


def leaves(values: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield each plain value with the path of its field."""
    if isinstance(values, dict):
        for name, each in values.items():
            yield from leaves(each, f"{path}.{name}" if path else name)
    elif isinstance(values, list):
        for number, each in enumerate(values):
            yield from leaves(each, f"{path}[{number}]")
    else:
        yield path, values


def test_there_are_interfaces_to_try() -> None:
    assert {"geometry_msgs", "rcl_interfaces", "nav2_msgs", "std_srvs", "sensor_msgs"} <= set(PACKAGES)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_installed_interface_is_filled_sent_and_read_back(package: str) -> None:
    from rclpy.serialization import deserialize_message, serialize_message

    for cls in classes(package):
        text, values = Sample().message(cls)
        message = MessageFiller().fill(cls(), read_fields(text))
        assert plain(message) == values, cls
        came = deserialize_message(serialize_message(message), cls)
        for path, value in leaves(values):
            check_path(cls, FieldPath(path))
            assert read_field(came, FieldPath(path)) == value, (cls, path)


BY_HAND: dict[str, tuple[str, str, str, dict[str, object]]] = {
    "a truth value": ("srv", "std_srvs/srv/SetBool", "data: true", {"data": True}),
    "the same in braces": ("srv", "std_srvs/srv/SetBool", "{data: yes}", {"data": True}),
    "a type without its kind": ("srv", "std_srvs/SetBool", "data: 1", {"data": True}),
    "parameters, with a constant of another message": (
        "srv",
        "rcl_interfaces/srv/SetParameters",
        """parameters: [{name: speed, value: {type: PARAMETER_DOUBLE, double_value: 1}},
        {name: names, value: {type: ParameterType.PARAMETER_STRING_ARRAY, string_array_value: [a, 2]}}]""",
        {
            "parameters[0].value.type": 3,
            "parameters[0].value.double_value": 1.0,
            "parameters[1].value.type": 9,
            "parameters[1].value.string_array_value": ["a", "2"],
        },
    ),
    "several poses": (
        "action",
        "nav2_msgs/action/NavigateThroughPoses",
        "poses: [{header: {frame_id: map, stamp: now}, pose: {position: {x: 1, y: 2.5}}}, {header: auto}]",
        {
            "poses[0].header.frame_id": "map",
            "poses[0].header.stamp.sec": NOW[0],
            "poses[0].pose.position.x": 1.0,
            "poses[0].pose.orientation.w": 1.0,
            "poses[1].header.stamp.nanosec": NOW[1],
        },
    ),
    "one pose": (
        "action",
        "nav2_msgs/action/NavigateToPose",
        "pose: {header: {frame_id: map}}, behavior_tree: 'a, b'",
        {"pose.header.frame_id": "map", "behavior_tree": "a, b"},
    ),
    "diagnostics, with a constant that is a byte": (
        "msg",
        "diagnostic_msgs/msg/DiagnosticArray",
        "status: [{level: ERROR, name: motor, values: [{key: a, value: 1.50}]}, {level: 3}]",
        {"status[0].level": 2, "status[0].values[0].value": "1.50", "status[1].level": 3},
    ),
    "a lifecycle transition by its constant": (
        "srv",
        "lifecycle_msgs/srv/ChangeState",
        "transition: {id: TRANSITION_ACTIVATE}",
        {"transition.id": 3},
    ),
    "a battery, with a constant": (
        "msg",
        "sensor_msgs/msg/BatteryState",
        "percentage: 1, power_supply_status: POWER_SUPPLY_STATUS_CHARGING, cell_voltage: [3, 3.5]",
        {"percentage": 1.0, "power_supply_status": 1, "cell_voltage": [3.0, 3.5]},
    ),
    "a covariance of whole and other numbers": (
        "msg",
        "geometry_msgs/msg/PoseWithCovariance",
        f"covariance: [{', '.join(['1', '0.5', '1e-3', '0'] * 9)}]",
        {"covariance": [1.0, 0.5, 0.001, 0.0] * 9},
    ),
    "a text with a comma, as ros2 takes it": (
        "msg",
        "std_msgs/msg/String",
        "data: Hello, World",
        {"data": "Hello, World"},
    ),
    "a text that reads as a number": ("msg", "std_msgs/msg/String", "data: 0123", {"data": "0123"}),
    "a time": ("msg", "builtin_interfaces/msg/Time", "{sec: 5, nanosec: 7}", {"sec": 5, "nanosec": 7}),
    "a header": (
        "msg",
        "std_msgs/msg/Header",
        "stamp: now, frame_id: map",
        {"stamp.sec": NOW[0], "frame_id": "map"},
    ),
    "a byte": ("msg", "std_msgs/msg/Byte", "data: 255", {"data": 255}),
    "bytes": ("msg", "std_msgs/msg/ByteMultiArray", "data: [1, 255]", {"data": [1, 255]}),
    "an image, as base64": (
        "msg",
        "sensor_msgs/msg/CompressedImage",
        "data: !!binary AQL/",
        {"data": [1, 2, 255]},
    ),
    "a character, which is a number in ROS 2": ("msg", "std_msgs/msg/Char", "data: 65", {"data": 65}),
    "a bounded list": (
        "msg",
        "rcl_interfaces/msg/ParameterDescriptor",
        "integer_range: [{from_value: 1, to_value: 5}]",
        {"integer_range[0].to_value": 5},
    ),
    "numbers in hexadecimal digits and as texts": (
        "msg",
        "std_msgs/msg/UInt8MultiArray",
        "data: [0x10, '7', 3.0], layout: {dim: [{label: x, size: 3}]}",
        {"data": [16, 7, 3], "layout.dim[0].size": 3},
    ),
    "a marker, on several lines": (
        "msg",
        "visualization_msgs/msg/Marker",
        "type: CUBE\naction: ADD\nscale:\n  x: 1\n  y: 2\ncolor: {a: 1}\n",
        {"type": 1, "action": 0, "scale.y": 2.0, "color.a": 1.0},
    ),
    "a goal's state": ("msg", "action_msgs/msg/GoalStatus", "status: STATUS_ABORTED", {"status": 6}),
    "nothing": ("srv", "std_srvs/srv/Trigger", "", {}),
}


def part_of(kind: str, written: str) -> Any:
    found = generated_type(kind, written)
    return getattr(found, PARTS[kind][0]) if PARTS[kind][0] else found


@pytest.mark.parametrize("name", BY_HAND)
def test_fields_are_taken_as_ros2_call_takes_them(name: str) -> None:
    kind, written, text, wanted = BY_HAND[name]
    message = MessageFiller(now=lambda: NOW).fill(part_of(kind, written)(), read_fields(text))
    assert {path: plain(read_field(message, FieldPath(path))) for path in wanted} == wanted


MISTAKES: dict[str, tuple[str, str, str, str, str]] = {
    "no such field": (
        "srv", "std_srvs/srv/SetBool", "dta: true", "dta", "there is no field 'dta'; did you mean 'data'?",
    ),
    "no such field in a list": (
        "action", "nav2_msgs/action/NavigateThroughPoses", "poses: [{}, {pse: 1}]", "pse",
        "there is no field 'poses[1].pse'; did you mean 'pose'?",
    ),
    "too large": (
        "msg", "std_msgs/msg/UInt8", "data: 300", "300", "data is 300, but must be uint8, an integer from 0 to 255",
    ),
    "not whole": (
        "msg", "std_msgs/msg/Int32", "data: 3.7", "3.7",
        "data is 3.7, but must be int32, an integer from -2147483648 to 2147483647",
    ),
    "a number for a truth value": (
        "srv", "std_srvs/srv/SetBool", "data: 3", "3", "data is 3, but must be boolean, true or false",
    ),
    "a text for a number": (
        "msg", "std_msgs/msg/Float64", "data: much", "much", "data is 'much', but must be double, a number",
    ),
    "too large for 32 bits": (
        "msg", "std_msgs/msg/Float32", "data: 1e39", "1e39", "data is '1e39', but must be float, a number",
    ),
    "a constant that is misspelt": (
        "msg", "diagnostic_msgs/msg/DiagnosticStatus", "level: EROR", "EROR",
        "level is 'EROR', but must be octet, an integer from 0 to 255; did you mean 'ERROR'?",
    ),
    "too few numbers": (
        "msg", "sensor_msgs/msg/Imu", "orientation_covariance: [1, 2]", "[1, 2]",
        "orientation_covariance has 2 values, but needs 9",
    ),
    "too many of a bounded list": (
        "msg", "rcl_interfaces/msg/ParameterDescriptor", "integer_range: [{}, {}]", "[{}, {}]",
        "integer_range has 2 values, but at most 1 are allowed",
    ),
    "one value for a list": (
        "msg", "std_msgs/msg/Int32MultiArray", "data: 5", "5",
        "data is 5, but must be sequence<int32>; write a list: [...]",
    ),
    "a number for a message": (
        "action", "nav2_msgs/action/NavigateToPose", "pose: 5", "5",
        "pose is 5, but must be fields of geometry_msgs/PoseStamped; write {header: ...}",
    ),
    "a word for a time": (
        "msg", "std_msgs/msg/Header", "stamp: soon", "soon",
        "stamp is 'soon', but must be fields of builtin_interfaces/Time; write now, or {sec: ..., nanosec: ...}",
    ),
    "fields for a number": (
        "msg", "std_msgs/msg/Float64", "data: {x: 1}", "{x: 1}", "data is fields (x), but must be double, a number",
    ),
    "no value": (
        "msg", "std_msgs/msg/String", "data: ~", "~",
        "data is without a value, but must be string; write '' for an empty string",
    ),
    "a text that is too long": (
        "msg", "rmw_dds_common/msg/NodeEntitiesInfo", f"node_name: {'x' * 300}", "x" * 300,
        "node_name has 300 characters, but at most 256 are allowed",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_told_with_its_place_and_the_remedy(name: str) -> None:
    kind, written, text, part, said = MISTAKES[name]
    with pytest.raises(InterfaceError) as raised:
        MessageFiller().fill(part_of(kind, written)(), read_fields(text))
    place = raised.value.place
    assert (str(raised.value).partition("; there is ")[0], place and text[slice(*place)]) == (said, part)


class Oddities:
    """A message with types that no package here has."""

    kinds = {  # noqa: RUF012 - never changed
        "letter": "char",
        "wide": "wchar",
        "name": "wstring<5>",
        "names": "sequence<wstring<5>, 2>",
        "three": "octet[3]",
    }

    def __init__(self) -> None:
        vars(self).update(dict.fromkeys(self.kinds))

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        return cls.kinds


def test_types_that_are_rare_are_read_by_their_names() -> None:
    text = "letter: x, wide: ü, name: 12345, names: [añb, 'x'], three: [1, 2, 0xff]"
    wanted = {
        "letter": "x",
        "wide": "ü",
        "name": "12345",
        "names": ["añb", "x"],
        "three": [b"\1", b"\2", b"\xff"],
    }
    assert vars(MessageFiller().fill(Oddities(), read_fields(text))) == wanted


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("letter: xy", "letter is 'xy', but must be char, one character"),
        ("name: 123456", "name has 6 characters, but at most 5 are allowed"),
        ("names: [a, b, c]", "names has 3 values, but at most 2 are allowed"),
        ("three: [1, 2]", "three has 2 values, but needs 3"),
        ("three: [1, 2, 256]", r"three\[2\] is 256, but must be octet, an integer from 0 to 255"),
    ],
)
def test_what_is_too_much_for_them_is_refused(text: str, said: str) -> None:
    with pytest.raises(InterfaceError, match=said):
        MessageFiller().fill(Oddities(), read_fields(text))


class TestKeys:
    POSES = "poses: [{pose: {position: {x: {x}, y: { @y }}}}, {last}], behavior_tree: {=}"

    def test_keys_are_named_where_a_value_may_be(self) -> None:
        text = "poses: [{pose: {position: {x: {x}, y: { @y }}}}, {last}], behavior_tree: {tree}"
        assert list(keys_of(read_fields(text))) == ["x", "@y", "last", "tree"]

    def test_a_key_has_its_place(self) -> None:
        text = "a: 1, b: { @key }"
        key, _ = read_fields(text).fields["b"]
        assert isinstance(key, KeyReference)
        assert text[slice(*key.place)] == "{ @key }"

    @pytest.mark.parametrize(
        "text", ["a: '{key}'", "a: {key: 1}", "a: {key: }", "a: {two words}", "a: {1}", "a: {}"]
    )
    def test_anything_else_is_no_key(self, text: str) -> None:
        assert not list(keys_of(read_fields(text)))

    def test_messages_lists_and_numbers_come_from_keys(self) -> None:
        from geometry_msgs.msg import PoseStamped

        goal = part_of("action", "nav2_msgs/action/NavigateThroughPoses")
        last = PoseStamped()
        last.pose.position.x = 7.0
        held: dict[str, object] = {"x": 1, "@y": "2.5", "last": last, "tree": 5, "all": [{"pose": {}}, last]}
        text = "poses: [{pose: {position: {x: {x}, y: {@y}}}}, {last}], behavior_tree: {tree}"
        message = MessageFiller(held.__getitem__).fill(goal(), read_fields(text))
        assert plain(message)["poses"][0]["pose"]["position"] == {"x": 1.0, "y": 2.5, "z": 0.0}
        assert (message.poses[1], message.behavior_tree) == (last, "5")
        assert MessageFiller(held.__getitem__).fill(goal(), read_fields("poses: {all}")).poses[1] == last

    def test_where_only_the_file_is_checked_keys_may_hold_anything(self) -> None:
        goal = part_of("action", "nav2_msgs/action/NavigateThroughPoses")
        assert (
            MessageFiller().fill(goal(), read_fields("poses: [{}, {last}], behavior_tree: {tree}")).poses
            == []
        )
        with pytest.raises(InterfaceError, match=r"poses\[1\] is 5"):
            MessageFiller().fill(goal(), read_fields("poses: [{last}, 5]"))

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("data: [", "is not YAML"),
            ("data", "is not a field with a value"),
            ("[a: 1]", "is not a field with a value"),
            ("a: &x [1], b: *x", r"a YAML alias \(\*\) is not allowed here"),
            ("a: &x [*x]", r"a YAML alias \(\*\) is not allowed here"),
            ("<<: {a: 1}", "a field must have a name"),
            ("? [a] : 1", "a field must have a name"),
            ("a: 1, a: 2", "'a' is given twice"),
            ("a: !!python/object/apply:os.system [ls]", None),
            ("a: !!python/name:os.system ''", "is not a value"),
            ("[" * 5000, "nested too deeply"),
            ("a: " + "[" * 5000, "nested too deeply"),
            ("a: '" + "x" * 200_000 + "'", "but at most 100000 are allowed"),
        ],
    )
    def test_what_is_no_yaml_or_would_be_more_than_data_is_refused(self, text: str, said: str | None) -> None:
        if said is None:  # a list with a tag is a list
            assert list(read_fields(text).fields) == ["a"]
            return
        with pytest.raises(ConversionError, match=said):
            read_fields(text)


class TestPaths:
    def test_fields_with_the_keys_that_they_are_written_to(self) -> None:
        found = read_destinations("error_code: {code}, path: {poses[0].pose: {first}}, a.b: {@c}")
        assert [(str(path), key) for path, key in found.keys] == [
            ("error_code", "code"),
            ("path.poses[0].pose", "first"),
            ("a.b", "@c"),
        ]

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("a: 5", "'a' needs the key to which the field is written"),
            ("a: [{b}]", "'a' needs the key to which the field is written"),
            ("'a b': {c}", "'a b' is not a field path"),
        ],
    )
    def test_what_has_no_key_is_told(self, text: str, said: str) -> None:
        with pytest.raises(ConversionError, match=said):
            read_destinations(text)

    @pytest.mark.parametrize("text", ["a b", ".a", "a.", "a[x]", "a[1", "__class__", "a.__dict__", "a[-1]"])
    def test_what_is_no_path_is_refused(self, text: str) -> None:
        with pytest.raises(ConversionError, match="is not a field path"):
            read_path(text)

    @pytest.mark.parametrize(
        ("path", "said"),
        [
            ("pose.positon", "there is no field 'pose.positon'; did you mean 'position'?"),
            ("pose.position.x.y", "there is no field 'pose.position.x.y'; the type has no fields"),
            ("covariance.x", "'covariance.x': the field that contains 'x' is a list"),
            ("covariance[36]", "'covariance' is double[36], and has no element 36"),
            ("pose[0]", "'pose' is geometry_msgs/Pose, not a list; write pose"),
        ],
    )
    def test_a_path_that_leads_nowhere_is_told(self, path: str, said: str) -> None:
        cls = part_of("msg", "geometry_msgs/msg/PoseWithCovariance")
        with pytest.raises(InterfaceError) as raised:
            check_path(cls, FieldPath(path))
        assert str(raised.value).startswith(said)

    def test_an_element_that_a_list_does_not_have_is_told(self) -> None:
        response = generated_type("srv", "rcl_interfaces/srv/SetParameters").Response()
        with pytest.raises(
            InterfaceError, match=r"'results\[0\].reason' does not exist: 'results' has 0 values"
        ):
            read_field(response, FieldPath("results[0].reason"))


@pytest.mark.parametrize(
    ("kind", "written", "said", "is_certain"),
    [
        ("srv", "std_srvs/srv/SetBol", "std_srvs/srv/SetBol is not installed; did you mean 'std_srvs/srv/SetBool'?", True),
        ("srv", "std_srvs/msg/SetBool", "is a type for topics, but a type for services is expected; did you mean 'std_srvs/srv/SetBool'?", True),
        ("srv", "std_srvs", "'std_srvs' is not a ROS type; write package/srv/Name, such as std_srvs/srv/Trigger", True),
        ("action", "std_srvs/action/Go", "the package 'std_srvs' has no action types", False),
        ("srv", "no_such_msgs/srv/X", "there is no interface package 'no_such_msgs' on this machine", False),
        ("action", "nav2_msgs/action/Teleport", "nav2_msgs/action/Teleport is not installed; install", False),
    ],
)  # fmt: skip
def test_a_type_that_is_not_there_is_told(kind: str, written: str, said: str, is_certain: bool) -> None:
    with pytest.raises(InterfaceError) as raised:
        generated_type(kind, written)
    assert said in str(raised.value)
    assert raised.value.is_certain is is_certain


def test_a_types_name_may_leave_its_kind_out() -> None:
    assert [full_type("srv", each) for each in ("a/B", "a/srv/B", "a")] == ["a/srv/B", "a/srv/B", "a"]


@pytest.mark.parametrize(
    ("kind", "written", "part", "text", "said"),
    [
        ("action", "nav2_msgs/action/ComputePathToPose", "Result", "error_code: 208, error_msg: walled in", "error_code 208 (NO_VALID_PATH): walled in"),
        ("action", "nav2_msgs/action/NavigateToPose", "Result", "error_code: 9000", "error_code 9000"),
        ("action", "nav2_msgs/action/NavigateToPose", "Result", "error_msg: why", "why"),
        ("srv", "std_srvs/srv/SetBool", "Response", "message: locked", "locked"),
        ("srv", "std_srvs/srv/Empty", "Response", "", ""),
        ("action", "nav2_msgs/action/ComputePathToPose", "Feedback", "", ""),
    ],
)  # fmt: skip
def test_an_error_is_told_with_its_constant_and_its_text(
    kind: str, written: str, part: str, text: str, said: str
) -> None:
    message = MessageFiller().fill(getattr(generated_type(kind, written), part)(), read_fields(text))
    assert reported_error(message) == said
