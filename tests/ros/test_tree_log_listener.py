"""Tests of listening to `behavior_tree_log`, over DDS."""

import pytest
from builtin_interfaces.msg import Time

from sar_compiler.importing.bag import TreeLogReader
from sar_compiler.ros.tree_log_listener import TreeLogListener

pytestmark = pytest.mark.ros


def test_status_changes_of_topic_are_read_as_from_bag(ros):
    from nav2_msgs.msg import BehaviorTreeLog, BehaviorTreeStatusChange

    listener = TreeLogListener(ros.node("watch"), "behavior_tree_log")
    publisher = ros.node("bt_navigator").create_publisher(BehaviorTreeLog, "behavior_tree_log", 10)
    ros.spin_until(publisher.get_subscription_count, "the listener")
    changes = [
        BehaviorTreeStatusChange(
            timestamp=Time(sec=100, nanosec=5000 * uid),
            node_name=name,
            uid=uid,
            previous_status="IDLE",
            current_status=status,
        )
        for uid, name, status in ((1, "FollowPath", "FAILURE"), (2, "Wait ü", "RUNNING"))
    ]
    publisher.publish(BehaviorTreeLog(event_log=changes))
    heard: list[bytes] = []

    def is_heard():
        heard.extend(listener.messages())
        return heard

    ros.spin_until(is_heard, "the message")
    reader = TreeLogReader("topic")
    reader.add(heard[0])
    found = reader.recording
    assert (found.names, [*found.times], [*found.uids]) == ({1: "FollowPath", 2: "Wait ü"}, [0, 5], [1, 2])
    assert [*found.statuses] == [3, 1]
    assert listener.messages() == []


def test_log_lines_of_nav2_are_read_as_from_bag(ros):
    from rcl_interfaces.msg import Log

    listener = TreeLogListener(ros.node("watch"), "behavior_tree_log")
    publisher = ros.node("bt_navigator").create_publisher(Log, "/rosout", 10)
    ros.spin_until(publisher.get_subscription_count, "the listener")
    heard: list[bytes] = []

    def is_heard():
        publisher.publish(Log(stamp=Time(sec=100), level=Log.INFO, name="bt_navigator", msg="Goal succeeded"))
        heard.extend(listener.lines())
        return any(b"Goal succeeded" in each for each in heard)

    ros.spin_until(is_heard, "the line")
    reader = TreeLogReader("topic")
    for each in heard:
        reader.add_line(each)
    assert reader.has_goal_end
