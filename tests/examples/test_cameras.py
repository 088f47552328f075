"""Tests of the examples with cameras: commands of the READMEs print the shown output, and the graph is as described."""

import signal

import pytest

from tests.examples.readme import steps

pytestmark = pytest.mark.ros

CAMERA = "examples/cameras/camera.py"
PROCESSOR = "examples/cameras/image_processor.py"
QUICK = ["-p", "rate_hz:=20.0"]


class Listener:
    """A node that records the messages on string topics."""

    def __init__(self, ros):
        self.ros = ros
        self.node = ros.node("listener")
        self.heard = {}

    def listen(self, topic):
        from std_msgs.msg import String

        self.heard[topic] = []
        self.node.create_subscription(String, topic, lambda text: self.heard[topic].append(text.data), 10)

    def wait_for(self, topic, count=1):
        """Wait for further messages on a topic."""
        wanted = len(self.heard[topic]) + count
        self.ros.spin_until(lambda: len(self.heard[topic]) >= wanted, f"{wanted} texts on {topic}")

    def wait_for_nodes(self, *names):
        """Wait until nodes with some full names are in the graph."""
        self.ros.spin_until(lambda: set(names) <= self.nodes(), f"the nodes {', '.join(names)}")

    def nodes(self):
        """Return the full names of the nodes in the graph."""
        found = self.node.get_node_names_and_namespaces()
        return {f"{namespace.rstrip('/')}/{name}" for name, namespace in found}


@pytest.fixture
def listener(ros):
    return Listener(ros)


def namespace_moves_topic_of_each_camera(listener):
    for topic in ("/front/image_raw", "/rear/image_raw", "/image_raw"):
        listener.listen(topic)
    yield
    listener.wait_for_nodes("/front/camera_node", "/rear/camera_node")
    listener.wait_for("/front/image_raw")
    listener.wait_for("/rear/image_raw")
    assert listener.heard["/image_raw"] == []
    assert listener.node.get_publishers_info_by_topic("/image_raw") == []
    assert "/camera_node" not in listener.nodes()


def remapped_node_has_only_its_new_name(listener):
    yield
    listener.wait_for_nodes("/front_camera", "/rear_camera")
    assert "/camera_node" not in listener.nodes()


def processor_on_remapped_topic_receives_images(listener):
    listener.listen("/seen")
    listener.listen("/image_raw")
    yield
    listener.wait_for("/seen")
    assert listener.heard["/seen"][0].endswith(" of an empty room")
    assert listener.heard["/image_raw"] == []


def processor_in_namespace_receives_only_its_camera(listener):
    listener.listen("/front/seen")
    listener.listen("/rear/seen")
    yield
    for side in ("front", "rear"):
        listener.wait_for(f"/{side}/seen", count=2)
    for side in ("front", "rear"):
        heard = listener.heard[f"/{side}/seen"]
        assert [text for text in heard if not text.endswith(f" of what is at the {side}")] == []


def parameter_option_overrides_every_section_of_file(listener):
    topics = ("/image_raw", "/front/image_raw")
    for topic in topics:
        listener.listen(topic)
    yield
    for topic in topics:
        listener.wait_for(topic)
        assert listener.heard[topic][0].endswith(" of a kitchen")


def no_promise(listener):
    yield


# Checks of the graph while the commands of a step run: set up before `yield`, checked after it.
PROMISES = {
    "namespaces-1": namespace_moves_topic_of_each_camera,
    "node_remapping-1": remapped_node_has_only_its_new_name,
    "topic_remapping-2": processor_on_remapped_topic_receives_images,
    "namespace_and_remapping-1": processor_in_namespace_receives_only_its_camera,
    "parameters-3": parameter_option_overrides_every_section_of_file,
}


CAMERA_EXAMPLES = ["namespaces", "node_remapping", "topic_remapping", "namespace_and_remapping", "parameters"]
ENDLESS = [step for example in CAMERA_EXAMPLES for step in steps(example)] + steps("cameras")[:1]


def test_every_promise_belongs_to_a_tested_step():
    assert PROMISES.keys() <= {str(step) for step in ENDLESS}


@pytest.mark.parametrize("step", ENDLESS, ids=str)
def test_step_prints_shown_output_keeps_promise_and_ends_on_ctrl_c(step, start, listener):
    promise = PROMISES.get(str(step), no_promise)(listener)
    next(promise)
    commands = step.start(start)
    try:
        listener.ros.spin_until(lambda: not step.unseen(commands), "what is shown")
    except AssertionError as error:
        outputs = "\n".join(command.output for command in commands)
        message = f"{error}: {step.unseen(commands)} is not in\n{outputs}"
        raise AssertionError(message) from None
    assert list(promise) == []
    for command in commands:
        command.send(signal.SIGINT)
    assert [command.end() for command in commands] == [0] * len(commands)


def test_arguments_refused_by_ros_are_reported_with_shown_line(start):
    step = steps("cameras")[1]
    commands = step.start(start)
    assert [command.end() for command in commands] == [2] * len(commands)
    assert step.unseen(commands) == []


def test_rate_outside_range_is_refused_with_the_range(start):
    camera = start("python", CAMERA, "--ros-args", "-p", "rate_hz:=0.0")
    assert camera.end() == 2
    assert "rate_hz out of range Min: 0.1, Max: 100.0, value: 0.0" in camera.output


def test_sigterm_ends_both_programs_with_status_0(start):
    programs = [start("python", CAMERA), start("python", PROCESSOR)]
    programs[0].wait_for("Publishing on /image_raw")
    programs[1].wait_for("Looking at /camera/image")
    assert [program.stop(signal.SIGTERM, within_sec=10.0) for program in programs] == [0, 0]


def test_processor_receives_nothing_without_remapping(start, listener):
    listener.listen("/image_raw")
    _, processor = (start(*command, "--ros-args", *QUICK) for command in steps("topic_remapping")[0].commands)
    listener.wait_for_nodes("/camera_node", "/image_processor")
    processor.wait_for("Looking at /camera/image")
    listener.wait_for("/image_raw", count=5)
    assert listener.node.get_publishers_info_by_topic("/camera/image") == []
    assert "I see" not in processor.output
