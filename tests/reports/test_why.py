"""Tests of the causes of a failed mission, with small trees that are really ticked."""

import json

import pytest
from py_trees.behaviours import StatusQueue
from py_trees.common import Status
from py_trees.composites import Parallel, Selector, Sequence
from py_trees.decorators import Inverter, Retry, Timeout
from py_trees.trees import BehaviourTree

from sar_compiler.cli.journal_command import main
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import Ending, JournalEntry
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.journal.status_watch import StatusWatch
from sar_compiler.reports.why import FailureAnalysis, cause_text, difference_text, first_difference
from sar_compiler.runtime.walking import pre_order
from search_and_rescue.search import Search
from search_and_rescue.zone_manager import ZoneManager

S, F, R = Status.SUCCESS, Status.FAILURE, Status.RUNNING


def why(stream):
    return FailureAnalysis.from_stream(stream).find_cause()


def leaf(name, *statuses):
    return StatusQueue(name, list(statuses), eventually=statuses[-1])


def tree_outline(node, line=1):
    kind = f"{type(node).__module__}.{type(node).__qualname__}"
    children = [tree_outline(child, line + 1) for child in node.children]
    return {
        "class": kind,
        "name": node.name,
        "attributes": {},
        "children": children,
        "file": "m.xml",
        "line": line,
    }


def tick_tree(root, ticks=1, journal=None, told=(), ending=Ending.OVER, **about):
    """Tick a tree; return its journal entries. The events of `told` come after the ticks."""
    journal = journal or Journal()
    stream: list[JournalEntry] = []
    journal.add_listener(stream.append)
    looks = [["condition" if node.name.endswith("?") else "action", ""] for node in pre_order(root)]
    constant = [number for number, node in enumerate(pre_order(root)) if node.name.startswith("always")]
    limits = {
        str(number): node.duration for number, node in enumerate(pre_order(root)) if isinstance(node, Timeout)
    }
    run = {"looks": looks, "constant": constant, "limits": limits}
    journal.begin({"tree": tree_outline(root), **about}, run)
    tree = BehaviourTree(root)
    tree.add_visitor(StatusWatch(root, journal))
    for _ in range(ticks):
        tree.tick()
    for kind, data in told:
        journal.record_event(kind, **data)
    journal.end_run(ending, int(root.status is not S), "The root has failed.")
    return stream


def names(answers):
    return [answer.name for answer in answers]


def test_chain_goes_from_root_to_failed_leaf():
    root = Sequence(
        "root",
        memory=True,
        children=[leaf("one", S), Sequence("inner", memory=True, children=[leaf("two", F)])],
    )
    reasons = why(tick_tree(root))
    assert [(each.name, each.depth, each.place) for each in reasons.chain] == [
        ("root", 0, "m.xml:1"),
        ("inner", 1, "m.xml:2"),
        ("two", 2, "m.xml:3"),
    ]
    assert names(reasons.causes) == ["two"]


def test_all_failed_alternatives_are_causes_and_last_comes_first():
    reasons = why(tick_tree(Selector("root", memory=False, children=[leaf("one", F), leaf("two", F)])))
    assert names(reasons.chain) == ["root", "one", "two"]
    assert names(reasons.causes) == ["two", "one"]


def test_failed_action_is_named_before_failed_condition():
    reasons = why(tick_tree(Selector("root", memory=False, children=[leaf("do", F), leaf("is?", F)])))
    assert names(reasons.causes) == ["do", "is?"]


@pytest.mark.parametrize(
    ("constant", "first"), [([2], "do"), ([], "always"), ([["x"], 2, None], "do"), (2, "always")]
)
def test_leaf_that_always_fails_is_not_first_cause(constant, first):
    began, *rest = tick_tree(Selector("root", memory=False, children=[leaf("do", F), leaf("always", F)]))
    run = {**began.data["run"], "constant": constant}
    told = [began._replace(data={**began.data, "run": run}), *rest]
    assert names(why(told).causes)[0] == first


def test_leaf_whose_earlier_failure_was_handled_is_not_first_cause():
    ways = Selector("ways", memory=False, children=[leaf("second", S, F), leaf("never", F)])
    root = Selector("root", memory=False, children=[leaf("never", F), ways])
    assert names(why(tick_tree(root, 2)).causes)[0] == "second"


def test_success_below_inverter_is_the_cause():
    assert names(why(tick_tree(Inverter("not", leaf("one", S)))).chain) == ["not", "one"]


def test_failure_is_named_before_inverted_success():
    ways = [leaf("one", F), Inverter("not", leaf("two", S))]
    assert names(why(tick_tree(Selector("root", memory=True, children=ways))).causes) == ["one", "two"]


def test_expired_time_limit_is_a_cause():
    root = Timeout("limit", leaf("one", R), duration=-1.0)
    reasons = why(tick_tree(root, 1))
    assert names(reasons.causes) == ["limit"]
    assert reasons.likeliest is not None
    assert reasons.likeliest.message == "its time limit of -1 s expired while one ran"


def test_failure_in_earlier_tick_of_same_activation_is_in_chain():
    root = Selector("root", memory=True, children=[leaf("one", F), leaf("two", R, R, F)])
    assert names(why(tick_tree(root, 3)).chain) == ["root", "one", "two"]


def test_failure_in_earlier_activation_is_no_cause():
    first, second = leaf("one", S, F), leaf("two", F)
    root = Sequence("root", memory=True, children=[first, second])
    assert names(why(tick_tree(Inverter("not", Inverter("not not", root)), 2)).causes) == ["one"]


def test_chain_of_retry_names_its_last_attempt():
    root = Retry("again", leaf("one", F, F, F), num_failures=3)
    reasons = why(tick_tree(root, 3))
    assert names(reasons.chain) == ["again", "one"]


def test_chain_of_parallel_names_failed_children():
    from py_trees.common import ParallelPolicy

    root = Parallel("root", ParallelPolicy.SuccessOnAll(), children=[leaf("one", S), leaf("two", F)])
    assert names(why(tick_tree(root)).chain) == ["root", "two"]


def test_successful_root_has_no_chain():
    reasons = why(tick_tree(leaf("one", S)))
    assert (reasons.chain, reasons.likeliest, reasons.outcome) == ((), None, "complete")
    assert cause_text(reasons) == "complete: The root has failed."


AT_HOME = {"x": 0.0, "y": 0.0, "yaw": 0.0}


def mission(update, told):
    """Return the causes of a failed mission: its root ends with a failed condition, after a failed action was handled.

    Args:
        update: Records events in the journal when the action is ticked.
        told: Events after the ticks.
    """

    class Act(StatusQueue):
        def update(self):
            update(journal)
            return F

    journal = Journal()
    Search(ZoneManager([{"id": "zone_a", **AT_HOME}], AT_HOME)).use_journal(journal)
    act = Selector("try", memory=False, children=[Act("act", [F], F), leaf("go on", S)])
    root = Sequence("root", memory=True, children=[act, leaf("complete?", F)])
    return why(tick_tree(root, 1, journal, told))


def test_leaf_that_lost_zone_is_named_before_failed_condition():
    lost = ("zone_abandoned", {"zone": "zone_a", "attempts": 1, "reason": ""})
    reasons = mission(lambda journal: journal.record_event("zone_started", zone="zone_a"), [lost])
    assert names(reasons.chain) == ["root", "complete?"]
    assert names(reasons.causes) == ["act", "complete?"]


def test_leaf_that_lost_report_is_named_even_if_zone_is_left_in_same_tick():
    def report(journal):
        journal.record_event("zone_started", zone="zone_a")
        journal.record_event("zone_searched", zone="zone_a", survivor=(1.0, 2.0))
        journal.record_event("zone_visited", zone="zone_a")

    assert names(mission(report, [("base_reached", {})]).causes) == ["act", "complete?"]


def test_failure_without_loss_for_mission_is_no_cause():
    def search(journal):
        journal.record_event("zone_started", zone="zone_a")
        journal.record_event("zone_searched", zone="zone_a", survivor=None)
        journal.record_event("zone_visited", zone="zone_a")

    assert names(mission(search, [("base_reached", {})]).causes) == ["complete?"]


def test_earlier_failures_are_listed_with_count():
    root = Sequence(
        "root", memory=True, children=[Retry("again", leaf("one", F, R, F, S), 5), leaf("two", F)]
    )
    (before,) = why(tick_tree(root, 4)).before
    assert (before.first.name, before.times, before.has_recovered) == ("one", 2, True)


def test_failure_that_root_recovered_from_is_no_cause():
    reasons = why(tick_tree(leaf("one", F, S), 2))
    assert reasons.went_on
    assert "The root failed, and then continued:" in cause_text(reasons)
    assert "Likeliest cause" not in cause_text(reasons._replace(outcome="complete"))


def test_last_failed_tick_of_root_is_known_after_recovery():
    inquiry = FailureAnalysis.from_stream(tick_tree(leaf("one", F, R, F, S), 4))
    inquiry.find_cause()
    assert inquiry.failed_tick == 3


@pytest.mark.parametrize(
    "odd",
    [
        {"node": 9, "tick": 1, "status": "FAILURE", "message": ""},
        {"node": 0, "status": "FAILURE", "message": ""},
        {"node": 0, "tick": 1, "status": "FAILURE"},
        {"node": "one", "tick": 1, "status": "FAILURE"},
        {},
    ],
    ids=["unknown node", "no tick", "no message", "text", "nothing"],
)
def test_malformed_status_entries_are_ignored(odd):
    stream = tick_tree(leaf("one", F))
    entry = stream[-1]._replace(kind="status", data=odd)
    assert names(why([*stream[:-1], entry, stream[-1]]).chain) == ["one"]
    assert why([stream[0]._replace(data={}), entry]).chain == ()


def test_line_break_in_reason_is_escaped():
    (line, *_) = cause_text(
        why(tick_tree(leaf("one", S)))._replace(said="complete: a\nThe root has failed:")
    ).splitlines()
    assert line == "complete: a\\nThe root has failed:"


def causes_of_abandoned_zone(*ways):
    """Return the causes of a failed mission that abandons its zone because each of these alternatives to search it fails."""

    class Abandon(StatusQueue):
        def update(self):
            journal.record_event("zone_abandoned", zone="zone_a", attempts=1, reason="")
            return S

    class Begin(StatusQueue):
        def update(self):
            journal.record_event("zone_started", zone="zone_a")
            return S

    journal = Journal()
    Search(ZoneManager([{"id": "zone_a", **AT_HOME}], AT_HOME)).use_journal(journal)
    search = Selector("search or give up", memory=True, children=[*ways, Abandon("give up", [S], S)])
    steps = [Begin("begin", [S], S), search, leaf("complete?", F)]
    return why(tick_tree(Sequence("root", memory=True, children=steps), 1, journal))


def test_handled_time_limit_is_named_before_later_failure():
    reasons = causes_of_abandoned_zone(Timeout("limit", leaf("drive", R), duration=0.0), leaf("postpone", F))
    assert names(reasons.causes) == ["limit", "postpone", "complete?"]
    assert reasons.likeliest is not None
    assert reasons.likeliest.message == "its time limit of 0 s expired while drive ran"
    assert [each.first.name for each in reasons.before] == ["limit", "postpone"]


def test_condition_that_caused_abandoned_zone_is_named_before_later_failure():
    ready = Sequence("search", memory=True, children=[leaf("ready?", F), leaf("drive", R)])
    assert names(causes_of_abandoned_zone(ready, leaf("postpone", F)).causes)[0] == "ready?"


def test_leaf_that_always_fails_is_named_if_nothing_failed_before_it():
    search = Sequence("search", memory=True, children=[leaf("always", F), leaf("drive", R)])
    assert names(causes_of_abandoned_zone(search, leaf("postpone", F)).causes)[0] == "always"


def test_failed_action_is_named_before_condition_that_led_to_it():
    search = Sequence("search", memory=True, children=[leaf("drive", F)])
    assert names(causes_of_abandoned_zone(leaf("is there?", F), search).causes)[0] == "drive"


def test_response_designed_to_fail_is_named_after_its_condition():
    response = Sequence("go home", memory=True, children=[leaf("home", S), leaf("always", F)])
    well = Selector("well or home", memory=True, children=[leaf("battery?", F), response])
    root = Sequence("root", memory=False, children=[well, leaf("drive", R)])
    assert names(why(tick_tree(root)).causes) == ["battery?", "always"]


def delay_end(stream):
    """Return the entries of a run as if it had ended long after its last tick."""
    return [*stream[:-1], stream[-1]._replace(wall=stream[-1].wall + 100.0)]


def test_run_ended_by_time_limit_names_longest_running_leaf():
    reasons = why(delay_end(tick_tree(Sequence("root", memory=True, children=[leaf("stuck", R)]), 3)))
    assert [(each.name, each.status) for each in reasons.causes] == [("stuck", "RUNNING"), ("run", "ENDED")]


def test_failed_condition_is_named_before_leaf_that_ran_instead():
    hold = Selector("free or hold", memory=False, children=[leaf("free?", F), leaf("hold", R)])
    assert names(why(delay_end(tick_tree(hold, 3))).causes) == ["free?", "hold", "run"]


def test_stopped_run_names_signal():
    began, *rest = tick_tree(leaf("drive", R), 2, ending=Ending.STOPPED)
    stopped = rest[-1]._replace(data={**rest[-1].data, "status": 130})
    first = why([began, *rest[:-1], stopped]).likeliest
    assert first is not None
    assert (first.name, first.status, first.message) == ("run", "STOPPED", "by SIGINT (Ctrl-C)")


def test_run_stopped_without_signal_names_reason():
    began, *rest = tick_tree(leaf("drive", R), 2, ending=Ending.STOPPED)
    stopped = rest[-1]._replace(data={**rest[-1].data, "status": 1, "reason": "the recording was stopped"})
    first = why([began, *rest[:-1], stopped]).likeliest
    assert first is not None
    assert (first.status, first.message) == ("STOPPED", "the recording was stopped")


def test_leaf_that_raised_is_named_with_its_error():
    stream = tick_tree(leaf("drive", R), 2, ending=Ending.FAILED)
    raised = stream[-1]._replace(kind="leaf_raised", data={"node": 0, "text": "no lens"})
    first = why([*stream[:-1], raised, stream[-1]]).likeliest
    assert first is not None
    assert (first.name, first.status, first.message) == ("drive", "RAISED", "no lens")


class TestFirstDifference:
    def test_runs_with_equal_statuses_have_no_difference(self):
        one, two = (
            tick_tree(Sequence("root", memory=True, children=[leaf("one", R, S)]), ticks) for ticks in (2, 2)
        )
        assert first_difference(one, two) is None
        assert "had the same statuses" in difference_text(None, ("a", "b"))

    def test_difference_is_first_differing_status(self):
        good, bad = (
            tick_tree(Sequence("root", memory=True, children=[leaf("one", S), leaf("two", status)]))
            for status in (S, F)
        )
        difference = first_difference(bad, good)
        assert difference is not None and difference.here and difference.there  # noqa: PT018
        assert difference.step == 1
        assert (difference.here.name, difference.here.status, difference.there.status) == (
            "two",
            "FAILURE",
            "SUCCESS",
        )

    def test_shorter_run_has_no_further_change(self):
        short, long = (tick_tree(leaf("one", R, S), ticks) for ticks in (1, 2))
        difference = first_difference(short, long)
        assert difference is not None and difference.there  # noqa: PT018
        assert (difference.here, difference.there.status) == (None, "SUCCESS")
        assert "no further change, because the run had ended" in difference_text(difference, ("a", "b"))


class TestWhyCommand:
    @pytest.fixture
    def places(self, tmp_path):
        """Return the journals of a failed and of a successful run."""
        made = []
        for status in (F, S):
            journal = open_journal(tmp_path / f"{status.value}.journal")
            tick_tree(Sequence("root", memory=True, children=[leaf("Drive\x1b[2J", status)]), 1, journal)
            journal.close()
            made.append(str(tmp_path / f"{status.value}.journal"))
        return made

    def test_text_output_names_likeliest_cause(self, places, capsys):
        assert main(["why", places[0]]) == 0
        shown = capsys.readouterr().out
        assert shown.startswith("FAILED: The root has failed.\n\nLikeliest cause:\n")
        assert r"Drive\x1b[2J FAILURE" in shown
        assert "(m.xml:2)" in shown

    def test_json_output_has_chain_and_difference(self, places, capsys):
        assert main(["why", places[0], "--against", places[1], "--format", "json"]) == 0
        data = json.loads(capsys.readouterr().out)
        assert [each["name"] for each in data["chain"]] == ["root", "Drive\x1b[2J"]
        assert (data["difference"]["alike"], data["difference"]["there"]["status"]) == (0, "SUCCESS")

    def test_text_output_compares_two_runs(self, places, capsys):
        assert main(["why", places[0], "--against", places[1]]) == 0
        assert "The runs differ after 0 equal status changes:" in capsys.readouterr().out

    @pytest.mark.parametrize("has_begun", [False, True])
    def test_journal_without_status_entries_is_no_failure(self, has_begun, tmp_path, capsys):
        file = JournalFile.create(tmp_path / "m.journal")
        if has_begun:
            file.begin_run({}, {}, 0.0)
        file.close()
        assert main(["why", str(tmp_path / "m.journal")]) == 0
        first = "Likeliest cause:\n  0:00  run KILLED, the process of the run was killed or crashed without recording the end of the run\n\n"
        said = (
            f"CRASHED: at 0:00: the robot was not driving\n\n{first}"
            if has_begun
            else "not begun: the run has not started\n\n"
        )
        assert capsys.readouterr().out == f"{said}The root has not failed.\n"
