"""Tests of the descriptions of Nav2's status and error codes."""

from types import SimpleNamespace

import pytest

from search_and_rescue.actions.navigation import describe_end


@pytest.mark.parametrize(
    ("status", "code", "words"),
    [
        (6, 208, "aborted (status 6), error code 208: there is no path to the goal"),
        (6, 105, "aborted (status 6), error code 105: the robot makes no progress"),
        (6, 199, "error code 199: the controller failed"),
        (6, 713, "error code 713: a recovery behavior failed"),
        (6, 9001, "error code 9001: Nav2 could not load its behavior tree"),
        (6, 308, "error code 308: there is no path to the goal"),
        (6, 301, "error code 301: the requested planner does not exist; the goal is not sent again"),
        (6, 309, "error code 309: the planner for several poses failed"),
        (6, 9101, "error code 9101: Nav2 could not load its behavior tree; the goal is not sent again"),
        (6, 60000, "error code 60000: an unknown code"),
        (6, 0, "error code 0: no code"),
        (5, 0, "canceled by another client (status 5), error code 0: none"),
        (0, 0, "unknown to the server (was it restarted?) (status 0)"),
        (2, 0, "not finished (status 2)"),
    ],
)
def test_failure_is_described_in_words(status: int, code: int, words: str) -> None:
    assert words in describe_end(status, SimpleNamespace(error_code=code))


def test_message_of_server_replaces_table_entry() -> None:
    result = SimpleNamespace(error_code=208, error_msg="the door is shut")
    assert describe_end(6, result).endswith("error code 208: the door is shut")


def test_result_of_older_version_has_no_code() -> None:
    assert "error code 0" in describe_end(6, SimpleNamespace())


def test_nav2_log_line_is_quoted_without_server_message() -> None:
    said = 'bt_navigator: "Initial robot pose is not available."'
    described = describe_end(6, SimpleNamespace(error_code=0), said)
    assert described.endswith(f"error code 0: no code ({said})")
    result = SimpleNamespace(error_code=208, error_msg="the door is shut")
    assert describe_end(6, result, said).endswith("error code 208: the door is shut")
