"""The examples with cameras: what their READMEs say is typed, and what they promise is seen in the graph."""

import signal

import pytest

from tests.examples.readme import steps

pytestmark = pytest.mark.ros

CAMERA = "examples/cameras/camera.py"
PROCESSOR = "examples/cameras/image_processor.py"
QUICK = ["-p", "rate_hz:=20.0"]


class Listener:
    """A node that keeps what it hears on topics of texts."""

    def __init__(self, ros):
        self.ros = ros
        self.node = ros.node("listener")
        self.heard = {}

    def listen(self, topic):
        from std_msgs.msg import String

        self.heard[topic] = []
        self.node.create_subscription(String, topic, lambda text: self.heard[topic].append(text.data), 10)

    def wait_for(self, topic, count=1):
        """Wait until so many texts more were heard."""
        wanted = len(self.heard[topic]) + count
        self.ros.spin_until(lambda: len(self.heard[topic]) >= wanted, f"{wanted} texts on {topic}")

    def wait_for_nodes(self, *names):
        """Wait until nodes are in the graph, by their full names."""
        self.ros.spin_until(lambda: set(names) <= self.nodes(), f"the nodes {', '.join(names)}")

    def nodes(self):
        """Return the full names of the nodes in the graph."""
        found = self.node.get_node_names_and_namespaces()
        return {f"{namespace.rstrip('/')}/{name}" for name, namespace in found}


@pytest.fixture
def listener(ros):
    return Listener(ros)


def a_namespace_moves_the_topic_of_each_camera(listener):
    for topic in ("/front/image_raw", "/rear/image_raw", "/image_raw"):
        listener.listen(topic)
    yield
    listener.wait_for_nodes("/front/camera_node", "/rear/camera_node")
    listener.wait_for("/front/image_raw")
    listener.wait_for("/rear/image_raw")
    assert listener.heard["/image_raw"] == []
    assert listener.node.get_publishers_info_by_topic("/image_raw") == []
    assert "/camera_node" not in listener.nodes()


def a_remapped_node_is_in_the_graph_by_its_new_name_alone(listener):
    yield
    listener.wait_for_nodes("/front_camera", "/rear_camera")
    assert "/camera_node" not in listener.nodes()


def remapped_to_one_topic_the_processor_passes_on_what_the_camera_takes(listener):
    listener.listen("/seen")
    listener.listen("/image_raw")
    yield
    listener.wait_for("/seen")
    assert listener.heard["/seen"][0].endswith(" of an empty room")
    assert listener.heard["/image_raw"] == []


def in_namespaces_each_processor_sees_its_own_camera_alone(listener):
    listener.listen("/front/seen")
    listener.listen("/rear/seen")
    yield
    for side in ("front", "rear"):
        listener.wait_for(f"/{side}/seen", count=2)
    for side in ("front", "rear"):
        heard = listener.heard[f"/{side}/seen"]
        assert [text for text in heard if not text.endswith(f" of what is at the {side}")] == []


def a_parameter_given_with_p_wins_over_every_section_of_the_file(listener):
    topics = ("/image_raw", "/front/image_raw")
    for topic in topics:
        listener.listen(topic)
    yield
    for topic in topics:
        listener.wait_for(topic)
        assert listener.heard[topic][0].endswith(" of a kitchen")


def nothing_more(listener):
    yield


# What is true in the graph while the commands of a step run: what comes before `yield`, and behind it.
PROMISES = {
    "namespaces-1": a_namespace_moves_the_topic_of_each_camera,
    "node_remapping-1": a_remapped_node_is_in_the_graph_by_its_new_name_alone,
    "topic_remapping-2": remapped_to_one_topic_the_processor_passes_on_what_the_camera_takes,
    "namespace_and_remapping-1": in_namespaces_each_processor_sees_its_own_camera_alone,
    "parameters-3": a_parameter_given_with_p_wins_over_every_section_of_the_file,
}


CAMERA_EXAMPLES = ["namespaces", "node_remapping", "topic_remapping", "namespace_and_remapping", "parameters"]
ENDLESS = [step for example in CAMERA_EXAMPLES for step in steps(example)] + steps("cameras")[:1]


def test_every_promise_is_of_a_step_that_is_tried():
    assert PROMISES.keys() <= {str(step) for step in ENDLESS}


@pytest.mark.parametrize("step", ENDLESS, ids=str)
def test_one_sees_what_the_readme_shows_and_promises_and_ctrl_c_ends_it(step, start, listener):
    promise = PROMISES.get(str(step), nothing_more)(listener)
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


def test_what_ros_does_not_accept_is_said_in_the_line_that_the_readme_shows(start):
    step = steps("cameras")[1]
    commands = step.start(start)
    assert [command.end() for command in commands] == [2] * len(commands)
    assert step.unseen(commands) == []


def test_a_rate_outside_the_range_is_refused_with_the_range(start):
    camera = start("python", CAMERA, "--ros-args", "-p", "rate_hz:=0.0")
    assert camera.end() == 2
    assert "rate_hz out of range Min: 0.1, Max: 100.0, value: 0.0" in camera.output


def test_sigterm_ends_both_programs_in_order(start):
    programs = [start("python", CAMERA), start("python", PROCESSOR)]
    programs[0].wait_for("Publishing on /image_raw")
    programs[1].wait_for("Looking at /camera/image")
    assert [program.stop(signal.SIGTERM, within_sec=10.0) for program in programs] == [0, 0]


def test_without_remapping_the_processor_sees_nothing_of_the_camera(start, listener):
    listener.listen("/image_raw")
    _, processor = (start(*command, "--ros-args", *QUICK) for command in steps("topic_remapping")[0].commands)
    listener.wait_for_nodes("/camera_node", "/image_processor")
    processor.wait_for("Looking at /camera/image")
    listener.wait_for("/image_raw", count=5)
    assert listener.node.get_publishers_info_by_topic("/camera/image") == []
    assert "I see" not in processor.output
