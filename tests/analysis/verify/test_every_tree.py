"""Tests of the questions about every tree: no error, every leaf can run, every run can end."""

from sar_compiler.analysis.verify.verdicts import AN_END, EVERY_LEAF, NO_ERROR, NO_LIVELOCK
from tests.analysis.verify.stage import BROKEN, PROVED, UNDECIDED, outcome, told, verdict, verified


def test_plain_sequence_is_proved():
    assert verified("<Sequence><A/><B/></Sequence>").is_proved


def test_leaf_after_one_that_always_fails_never_runs():
    found = verdict(verified("<Sequence><A/><AlwaysFailure/><B/></Sequence>"), EVERY_LEAF)
    assert (found.outcome, found.reason) == (BROKEN, "no run ticks 'B'")


def test_built_in_leaf_can_be_one_that_never_runs():
    found = verdict(
        verified('<Fallback><AlwaysSuccess/><Script name="Plan" code="x := 1"/></Fallback>'), EVERY_LEAF
    )
    assert found.reason == "no run ticks 'Plan'"


def test_read_of_unwritten_key_is_error_with_its_run():
    found = verdict(
        verified(
            '<Fallback><Sequence><A/><Script code="x := 1"/><B/></Sequence><Script code="y := x"/></Fallback>'
        ),
        NO_ERROR,
    )
    assert (found.outcome, told(found.trace)) == (BROKEN, ["A:FAILURE"])
    assert "there is no variable 'x'" in found.trace.ticks[-1].error


def test_runs_that_end_with_error_leave_other_questions_undecided():
    verification = verified('<Sequence><Script code="y := x"/><A/></Sequence>')
    found = verdict(verification, NO_LIVELOCK)
    assert (found.outcome, found.reason) == (
        UNDECIDED,
        "a tick raises an error, and runs were not explored beyond such ticks",
    )
    assert outcome(verification, AN_END) is UNDECIDED


def test_leaf_that_runs_forever_prevents_end_of_run():
    verification = verified("<Sequence><A/><Running/></Sequence>")
    assert outcome(verification, AN_END) is BROKEN
    found = verdict(verification, NO_LIVELOCK)
    assert (found.outcome, told(found.trace), found.trace.loop) == (BROKEN, ["A:SUCCESS", ""], 1)


def test_awaited_outcome_arrives_eventually():
    assert outcome(verified("<A/>"), NO_LIVELOCK) is PROVED


def test_unlimited_retries_are_livelock():
    found = verdict(
        verified('<RetryUntilSuccessful num_attempts="-1"><A/></RetryUntilSuccessful>'), NO_LIVELOCK
    )
    assert found.outcome is BROKEN
    assert "A:FAILURE" in told(found.trace)[-1]


def test_limited_retries_are_not_livelock():
    assert verified('<RetryUntilSuccessful num_attempts="3"><A/></RetryUntilSuccessful>').is_proved


def test_leaves_that_interrupt_each_other_are_livelock():
    # A restarts in every tick, which halts B before it ends.
    found = verdict(verified("<ReactiveSequence><A/><B/></ReactiveSequence>"), NO_LIVELOCK)
    assert found.outcome is BROKEN
    assert any("B:halted" in tick for tick in told(found.trace))


def test_timer_expires_eventually():
    verification = verified('<Sequence><Sleep msec="100"/><Delay delay_msec="50"><A/></Delay></Sequence>')
    assert verification.is_proved


def test_run_to_dead_end_stops_at_last_end():
    latch = '<Precondition if="x == 0" else="RUNNING"><Sequence><A/><Script code="x := 1"/></Sequence></Precondition>'
    found = verdict(
        verified(f'<Sequence><Script code="x := 0" oneshot="ON_COMPLETION"/>{latch}</Sequence>'), AN_END
    )
    assert (found.outcome, told(found.trace)) == (BROKEN, ["A:SUCCESS"])


def test_timeout_ends_wait_for_leaf():
    body = '<Timeout msec="100"><A/></Timeout>'
    answers = "outcomes: {A: [RUNNING]}"
    assert verified(body, answers).is_proved
    assert outcome(verified("<A/>", answers), AN_END) is BROKEN


def test_timer_can_expire_before_or_after_any_outcome():
    never = "properties: {p: {never: B starts}}"
    tree = '<Fallback><Timeout msec="100"><A/></Timeout><B/></Fallback>'
    found = verdict(verified(tree, f"{never}\noutcomes: {{A: [SUCCESS, RUNNING]}}"), "p")
    assert told(found.trace)[:1] == ["A:RUNNING"]
    assert "A:halted" in told(found.trace)[1]


def test_finished_oneshot_stays_finished():
    verification = verified('<A oneshot="ON_COMPLETION"/>', "properties: {p: {at_most_once: A SUCCESS}}")
    assert verification.is_proved
    assert outcome(verified("<A/>", "properties: {p: {at_most_once: A SUCCESS}}"), "p") is BROKEN


def test_blackboard_is_part_of_state():
    # The second attempt reads the value that the first one has written.
    tree = """<RetryUntilSuccessful num_attempts="2"><Sequence>
        <SetBlackboard value="1" output_key="tried" _onSuccess="again := n"/>
        <Script code="n += 1"/><ScriptCondition code="n == 2"/><A/></Sequence></RetryUntilSuccessful>"""
    start = f'<Sequence><Script code="n := 0"/>{tree}</Sequence>'
    assert outcome(verified(start), EVERY_LEAF) is PROVED
    assert outcome(verified(start.replace("n == 2", "n == 3")), EVERY_LEAF) is BROKEN


def test_tree_with_unbounded_states_is_undecided():
    tree = '<Sequence><A _onSuccess="n := 0; m := -1" oneshot="ON_COMPLETION"/><Script code="n += 1" _skipIf="n == m"/></Sequence>'
    verification = verified(tree, max_states=300)
    assert not verification.complete
    assert outcome(verification, NO_LIVELOCK) is UNDECIDED
    assert verification.growing[0][0] == "n"


def test_counterexample_within_state_limit_is_found():
    tree = (
        '<Parallel success_count="2"><RetryUntilSuccessful num_attempts="-1"><A/></RetryUntilSuccessful>'
        '<KeepRunningUntilFailure><Sequence><B oneshot="ON_COMPLETION" _onSuccess="n := 0" _onFailure="n := 0"/>'
        '<Script code="n += 1; m := n / 2"/><AlwaysSuccess _skipIf="m == 0.1"/></Sequence></KeepRunningUntilFailure></Parallel>'
    )
    found = verified(tree, "properties: {p: {never: A FAILURE}}", max_states=200)
    assert (found.complete, outcome(found, "p")) == (False, BROKEN)
