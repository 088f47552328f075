"""Tests that each statement on the pages about security and failures has tests.

`TESTED_BY` lists the tests of each sentence and of each table row, by its beginning. A row may name its tests in its last cell instead.
`NO_BEHAVIOUR` lists the sentences that state no behaviour of the project, such as advice and definitions.
"""

import re
from pathlib import Path

import pytest

from sar_compiler import opener
from sar_compiler.documents.located import MAX_VALUES
from sar_compiler.missions import parameter_file
from sar_compiler.ros import message_values, signals
from sar_compiler.sim import occupancy
from sar_compiler.web import feed, page_server
from search_and_rescue import areas_file
from tests.docs.markdown import codes, prose, tables
from tests.docs.test_reliability_page import PROMISES, all_tests, promise

SECURITY, RELIABILITY = Path("docs/concepts/security.md"), Path("docs/concepts/failures-and-recovery.md")
NO_BEHAVIOUR = {
    SECURITY: (
        "This page states which inputs",
        "A hostile file may also try",
        "command line, environment, installed packages",
        "A path that a tree passes to a leaf",
        "Everyone with an account",
        "The guardian does not know about leaves",
        "If the computer, its container",
        "Use one of these: a base that stops",
        "If only the sender of `cmd_vel` fails",
        "Everyone in the ROS domain can call",
        "ROS 2 has no authentication",
        "Everyone in the domain can send",
        "If the domain must extend beyond",
        "`ROS_DOMAIN_ID` is not an access control",
        "Use SROS 2",
        "SROS 2 restricts each participant",
        "While a mission runs in a rehearsal",
        "The project's tests do not cover",
        "Write to the maintainers first",
        "See the security policy",
    ),
    RELIABILITY: (
        "This page lists how `sar-run` reacts",
        "Items with † were",
        "Names that end in `_sec`",
        "*Detection takes* states the time",
        "If a process dies without notice",
        "For the limits for files, see",
        "Start the mission and Nav2 with this profile",
        "If the network is silent",
        "On a weak Wi-Fi",
    ),
}
TESTED_BY = {
    SECURITY: {
        "leaves from `--nodes`": (
            "test_modules_named_by_user_are_imported", "test_trust_imports_modules_beside_configuration_and_is_recorded",
        ),
        "tree files, palettes": ("test_extreme_content_is_a_finding_or_an_error_message", "test_no_command_imports_untrusted_modules"),
        "responses of services and actions": ("test_impossible_survivor_position_is_rejected_on_any_map", "test_description_of_any_drive_end_is_one_clean_line"),
        "All files are read by one opener": ("test_only_the_opener_opens_files",),
        "The opener obtains a handle": (
            "test_non_file_is_rejected_without_blocking", "test_file_replaced_by_link_after_check_is_not_read",
        ),
        "The project's tests require": ("test_each_file_reader_is_tested_with_hostile_files",),
        "Then the opener reads the same file": ("test_file_at_limit_is_complete_and_larger_one_is_not_read_further",),
        "The path is a pipe, a device": ("test_non_file_is_rejected_without_blocking",),
        "A link points outside": ("test_file_outside_folder_is_not_read", "test_file_replaced_by_link_after_check_is_not_read"),
        "A folder is replaced by a link": ("test_folder_replaced_by_link_does_not_extend_allowed_paths",),
        "A name contains a zero byte": ("test_impossible_file_name_is_an_error_message",),
        "A file exceeds its limit": ("test_growing_file_is_read_up_to_its_limit", "test_limits_on_security_page_match_code"),
        "A file has a million elements": (
            "test_extreme_content_is_a_finding_or_an_error_message", "test_file_with_too_many_elements_is_not_read_completely",
            "test_limits_on_security_page_match_code",
        ),
        "A file contains NaN": ("test_extreme_content_is_a_finding_or_an_error_message",),
        "Commands read pipes": ("test_shell_pipe_is_read_to_its_end",),
        "An agent reads files outside": (
            "test_call_reads_nothing_outside_the_folders", "test_call_lists_no_folder_outside_the_folders",
            "test_file_replaced_after_check_is_never_read_outside", "test_no_tool_argument_reads_outside_the_folders",
        ),
        "The tools of an agent exhaust": (
            "test_two_calls_run_at_a_time_and_all_are_answered", "test_call_has_low_priority_and_memory_limit",
            "test_call_over_time_limit_is_aborted_and_next_one_is_answered", "test_too_large_result_and_killed_call_are_reported",
        ),
        "An open editor exhausts": (
            "test_check_over_time_limit_is_reported_and_next_file_is_checked",
            "test_request_waiting_for_a_check_can_be_cancelled", "test_cancelled_command_leaves_no_process",
        ),
        "A tree changes after": (
            "test_tree_runs_only_as_approved", "test_other_tree_of_approved_file_may_not_start",
            "test_changed_file_is_named", "test_changed_parameter_is_named_with_both_values_and_approve_command",
            "test_areas_file_of_parameter_belongs_to_approval",
        ),
        "An approval is forged": ("test_approval_folder_writable_by_others_is_ignored", "test_approval_record_writable_by_others_is_ignored"),
        "A module is replaced": (
            "test_module_replaced_after_hashing_is_not_imported", "test_trusted_module_is_run_from_source_and_not_from_bytecode",
        ),
        "A file runs code": (
            "test_no_code_from_files_is_evaluated", "test_modules_in_checkout_are_not_imported", "test_installed_modules_are_imported",
            "test_installed_modules_of_packages_without_leaves_are_not_imported",
        ),
        "A file names a file elsewhere": (
            "test_file_outside_folder_is_not_read", "test_palette_linked_from_outside_is_not_read",
            "test_world_cannot_name_map_outside_its_folder", "test_map_cannot_name_image_outside_its_folder",
            "test_scenario_cannot_name_trace_outside_its_folder", "test_configuration_outside_repository_may_only_name_its_own_folder",
        ),
        "A file expands": (
            "test_doctype_entities_are_never_expanded", "test_exponentially_growing_trees_are_rejected_before_they_are_built",
        ),
        "A journal contains views": ("test_foreign_database_object_is_rejected_by_name",),
        "A journal is replaced while": (
            "test_journal_replaced_after_check_is_not_read",
            "test_replaced_wal_or_shm_file_is_neither_followed_nor_waited_for",
        ),
        "A journal has circular": ("test_reading_stops_if_it_takes_too_many_steps_for_file_size",),
        "A journal names a file": ("test_file_named_by_journal_is_not_read",),
        "A journal was altered": (
            "test_alteration_is_detected_with_its_first_wrong_entry",
            "test_recomputed_chain_is_detected_only_with_head",
        ),
        "A journal has positions": (
            "test_non_finite_number_is_null_in_json_output", "test_event_with_invalid_position_is_rejected",
            "test_infinite_time_is_rejected",
        ),
        "For damaged files and for escape sequences": ("test_every_promise_names_its_tests",),
        "Numbers in parameter files": ("test_number_must_be_finite", "test_error_in_world_file_is_reported_with_location"),
        "Positions in worlds and maps": ("test_error_in_world_file_is_reported_with_location",),
        "A node responds with a survivor": (
            "test_impossible_position_is_a_failure", "test_survivor_position_must_be_inside_map",
            "test_impossible_survivor_position_is_rejected_on_any_map", "test_limits_on_security_page_match_code",
        ),
        "A node reports a survivor without a position": ("test_report_at_invalid_position_is_not_acknowledged",),
        "A node sends an error text": ("test_description_of_any_drive_end_is_one_clean_line", "test_server_message_is_escaped_and_shortened_in_log"),
        "A node claims, on `ACTION/_mission`": (
            "test_running_mission_takes_precedence_over_older_starting_mission",
            "test_younger_of_two_running_missions_gives_way",
        ),
        "A node responds to another goal": (
            "test_result_of_abandoned_query_is_ignored", "test_late_response_of_old_call_is_ignored",
        ),
        "A node sends `sar-run --serve` a goal": (
            "test_client_runs_trees_by_name_one_after_another", "test_invalid_payload_is_rejected",
            "test_payload_sets_parameters_and_result_reports_their_errors",
        ),
        "`--groot2` listens": ("test_publisher_listens_on_loopback_only",),
        "No request changes the tree": ("test_no_request_changes_tree",),
        "A request of more than 1 MiB": ("test_oversized_request_closes_only_its_connection",),
        "Ctrl-C, SIGTERM and SIGHUP": (
            "test_run_stopped_during_navigation_cancels_its_goal",
            "test_goal_is_canceled_and_status_is_that_of_hangup",
        ),
        "A second Ctrl-C or SIGTERM": (
            "test_run_with_blocking_leaf_ends_and_its_goal_is_canceled", "test_command_blocked_by_import_ends",
            "test_simultaneous_signals_are_one_request", "test_limits_on_security_page_match_code",
        ),
        "After SIGKILL": ("test_guardian_cancels_goal_of_killed_mission",),
        "A run with a journal": ("test_guardian_is_default_for_journaled_run_of_real_robot",),
        "The guardian is a separate process": ("test_guardian_cancels_goal_of_killed_mission",),
        "Other runs have a guardian": ("test_guardian_is_default_for_journaled_run_of_real_robot",),
        "The guardian acts when": (
            "test_guardian_cancels_goal_of_killed_mission",
            "test_guardian_names_leaf_that_holds_interpreter_and_cancels_goal",
        ),
        "The guardian cancels the active goals": (
            "test_guardian_waits_for_end_of_canceled_goal", "test_unending_goal_is_reported_as_possible_motion",
        ),
        "Ctrl-C and the end of a terminal": ("test_guardian_is_not_ended_by_ctrl_c_or_signals",),
        "The guardian knows the goals": ("test_killed_guardian_is_replaced_and_new_one_knows_active_goal",),
        "`--view web`, `sar-journal replay`": ("test_server_listens_only_on_localhost",),
        "Every user of this machine": (
            "test_tool_needs_token_unless_it_is_read_only",
            "test_report_is_served_as_page_with_inline_style",
        ),
        "Everyone who has the printed address": (
            "test_command_with_token_is_accepted", "test_command_without_token_is_refused", "test_each_run_has_its_own_token",
        ),
        "A site that is open": (
            "test_foreign_origin_is_refused", "test_foreign_host_name_is_refused",
            "test_own_origin_is_accepted_under_each_local_name", "test_page_is_served_with_strict_security_headers",
        ),
        "A tree, a message or a log line": (
            "test_markup_in_untrusted_texts_is_escaped", "test_page_is_served_with_strict_security_headers",
        ),
        "A program that opens connections": (
            "test_number_of_connections_is_limited", "test_browser_that_does_not_read_is_disconnected_and_can_return",
            "test_limits_on_security_page_match_code",
        ),
        "A request for other files": ("test_unknown_path_is_not_found",),
        "Keep the domain on the machine": ("test_discovery_range_defaults_to_localhost",),
        "`sar-run --sim` and `sar-sim` set this": ("test_discovery_range_defaults_to_localhost", "test_discovery_range_of_user_is_kept"),
        "The guardian gets the `--enclave`": ("test_guardian_is_default_for_journaled_run_of_real_robot",),
    },
    RELIABILITY: {
        "Each item is tested": ("test_every_promise_names_its_tests",),
        "The run considers a goal ended when": (
            "test_lost_result_is_read_from_status_topic", "test_goal_fails_if_restarted_server_does_not_know_it",
        ),
        "If the run cannot confirm the end": ("test_run_stopped_with_unending_goal_reports_it_and_exits_with_4",),
        "A server that stops responding": (
            "test_goal_of_silent_server_fails_and_is_canceled",
            "test_killed_server_is_detected_with_and_without_feedback",
        ),
        "While a mission drives with": ("test_observer_claims_nothing_and_sees_running_mission", "test_younger_of_two_starting_missions_gives_way"),
        "The tree defines the reaction": ("test_guarded_mission_is_verified",),
        "`verify` proves this reaction": ("test_guarded_mission_is_verified",),
        "`config/fastdds_profile.xml` shortens": (
            "test_killed_server_leaves_graph_early_with_shipped_profile",
        ),
        "Other missions watch this topic": ("test_observer_claims_nothing_and_sees_running_mission", "test_younger_of_two_starting_missions_gives_way"),
        "Then another process must resume": ("test_suspended_run_that_receives_nothing_is_resumed_by_new_process",),
        "The other participants also drop": ("test_suspended_run_that_receives_nothing_is_resumed_by_new_process",),
    },
}  # fmt: skip
PAGES = tuple(TESTED_BY)


def statements(page: Path) -> list[str]:
    """Return the sentences of a page's paragraphs and lists, and the first cells of rows that name no test; links become their texts."""
    rows = [row for row in tables(page) if page != RELIABILITY or promise(row[0], row[2]) not in PROMISES]
    found = [_without_links(cells[0]) for _, _, cells in rows if not _names_tests(cells[-1])]
    in_rows = {number for _, number, _ in tables(page)}
    paragraphs, current = list[str](), ""
    for number, line in [*prose(page), (0, "")]:
        if number in in_rows:
            continue
        item = re.match(r"[-*] ", line)
        if not line.strip() or item or line.startswith(("#", "|")):
            paragraphs.append(current.strip())
            current = "" if line.startswith(("#", "|")) else line[item.end() if item else 0 :]
        else:
            current = f"{current} {line.strip()}"
    for paragraph in paragraphs:
        found += filter(None, re.split(r"(?<=[.!?])\s+(?=[A-Z`\[*])", _without_links(paragraph)))
    return found


def _without_links(text: str) -> str:
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)


def _names_tests(cell: str) -> bool:
    return cell == "the same" or any(each.startswith("test_") for each in codes(cell))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_statement_has_a_test_or_states_no_behaviour(page):
    known = [*TESTED_BY[page], *NO_BEHAVIOUR[page]]
    assert [each for each in statements(page) if not any(each.startswith(start) for start in known)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_listed_beginning_matches_exactly_one_statement(page):
    counts = {
        start: sum(each.startswith(start) for each in statements(page))
        for start in (*TESTED_BY[page], *NO_BEHAVIOUR[page])
    }
    assert {start: count for start, count in counts.items() if count != 1} == {}


def test_tests_of_every_statement_exist():
    held = [(page.stem, start, named) for page in PAGES for start, named in TESTED_BY[page].items()]
    assert [(page, start) for page, start, named in held if not named] == []
    assert [(*each, name) for *each, named in held for name in named if name not in all_tests()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_table_row_has_as_many_cells_as_its_header(page):
    head, wrong = None, []
    for number, line in prose(page):
        cells = len(re.split(r"(?<!\\)\|", line.strip())) if line.startswith("|") else None
        head = head or cells if cells else None
        if cells != head:
            wrong.append(number)
    assert wrong == []


def test_limits_on_security_page_match_code():
    text = SECURITY.read_text(encoding="utf-8")
    mebibytes = 2**20
    for said, number in (
        ("a tree {} MiB", opener.TREE.limit / mebibytes),
        (
            "a scenario, a world, a file of properties or a `sar.toml` {} MiB",
            opener.DOCUMENT.limit / mebibytes,
        ),
        ("areas {} MiB", areas_file._MAX_BYTES / mebibytes),
        ("the image of a map {} MiB", opener.IMAGE.limit / mebibytes),
        ("and {} million pixels", occupancy._MAX_CELLS / 1e6),
        ("{} values in a scenario", MAX_VALUES),
        ("{} names and values in a parameter file", parameter_file._MAX_EVENTS),
        ("Without a map the limit is {} km", message_values.FARTHEST_M / 1000.0),
        ("{} connections at once", page_server._CONNECTIONS),
        ("{} MB waiting for each", feed._MAX_WAITING / 1e6),
    ):
        assert said.format(f"{number:,g}" if number < 1000 else f"{number:,}") in text
    assert signals._TOGETHER_SEC == 0.5
    assert "more than half a second later" in text
