"""Tests of the ticks of recorded runs in which leaves with their own threads end.

A thread logs the end of its leaf at any moment. The parent processes this end when it ticks the leaf again.
"""

import pytest

from sar_compiler.compiler.sketch import sketch_tree
from sar_compiler.importing.recorded_tree import run_nodes
from sar_compiler.importing.recording import WORDS, Recording
from sar_compiler.importing.ticks import TickFinder
from sar_compiler.nodes.binding.binder import bind_all
from sar_compiler.nodes.palettes import load_palettes
from sar_compiler.nodes.registry import Registry, default_registry
from tests.trees import forest

REGISTRY = Registry([*default_registry().specs(), *load_palettes(["nav2:jazzy"])])
STEP_USEC = 5


def ticks_of(body, log):
    """Return the ticks of a log, each as a string of its changes.

    Each line of the log contains a time in milliseconds, and the changes that follow each other quickly from this time on.
    """
    (tree,) = bind_all(forest(body), REGISTRY).trees
    nodes = run_nodes(sketch_tree(tree, ()))
    names = [node.name for node in nodes]
    recording = Recording("FileLogger2", 0.0)
    for line in log.strip().splitlines():
        begin, _, changes = line.partition(":")
        for place, change in enumerate(changes.split(",")):
            name, status = change.split()
            time = int(begin) * 1000 + STEP_USEC * place
            recording.add(time, names.index(name) + 1, WORDS.index(status))
    ticks = list(TickFinder(nodes, recording).ticks())
    changes = [
        f"{names[uid - 1]} {WORDS[status]}"
        for uid, status in zip(recording.uids, recording.statuses, strict=True)
    ]
    return [", ".join(changes[tick.first : tick.behind]) for tick in ticks]


def after_battery_check(control):
    """Return a tree that ticks a condition, and then a control, in each tick."""
    return f'<ReactiveSequence name="root"><BatteryOk/>{control}</ReactiveSequence>'


@pytest.mark.parametrize(
    ("control", "status"),
    [
        ('<Parallel name="both" success_count="1" failure_count="1"><Arm/><Drive/></Parallel>', "SUCCESS"),
        ('<Parallel name="both" success_count="1" failure_count="1"><Arm/><Drive/></Parallel>', "FAILURE"),
        ('<Parallel name="both" success_count="2" failure_count="2"><Arm/><Drive/></Parallel>', "FAILURE"),
    ],
    ids=["success_count is reached", "failure_count is reached", "success_count is out of reach"],
)
def test_end_that_decides_parallel_moves_to_tick_in_which_parallel_ends(control, status):
    ticks = ticks_of(
        after_battery_check(control),
        f"""
          0: root RUNNING, BatteryOk SUCCESS, both RUNNING, Arm RUNNING, Drive RUNNING, BatteryOk IDLE
        100: BatteryOk SUCCESS, BatteryOk IDLE
        150: Arm {status}
        200: BatteryOk SUCCESS, Arm IDLE, Drive IDLE, both {status}
        """,
    )
    assert ticks[1:] == [
        "BatteryOk SUCCESS, BatteryOk IDLE",
        f"BatteryOk SUCCESS, Arm {status}, Arm IDLE, Drive IDLE, both {status}",
    ]


@pytest.mark.parametrize(
    "control",
    [
        '<ParallelAll name="both"><Arm/><Drive/></ParallelAll>',
        '<Parallel name="both" success_count="{count}"><Arm/><Drive/></Parallel>',
    ],
    ids=["ParallelAll", "unknown success_count"],
)
def test_end_of_last_running_child_moves_to_tick_in_which_parallel_ends(control):
    ticks = ticks_of(
        after_battery_check(control),
        """
          0: root RUNNING, BatteryOk SUCCESS, both RUNNING, Arm RUNNING, Drive RUNNING, BatteryOk IDLE
        100: BatteryOk SUCCESS, Arm SUCCESS, BatteryOk IDLE
        150: Drive SUCCESS
        200: BatteryOk SUCCESS, Arm IDLE, Drive IDLE, both SUCCESS
        """,
    )
    assert ticks[1:] == [
        "BatteryOk SUCCESS, Arm SUCCESS, BatteryOk IDLE",
        "BatteryOk SUCCESS, Drive SUCCESS, Arm IDLE, Drive IDLE, both SUCCESS",
    ]


@pytest.mark.parametrize(
    ("control", "status"),
    [
        ('<Parallel name="both" success_count="2" failure_count="1"><Arm/><Drive/></Parallel>', "SUCCESS"),
        ('<Parallel name="both" success_count="1" failure_count="2"><Arm/><Drive/></Parallel>', "FAILURE"),
        ('<Parallel name="both" success_count="{n}" failure_count="2"><Arm/><Drive/></Parallel>', "FAILURE"),
        ('<ParallelAll name="both"><Arm/><Drive/></ParallelAll>', "FAILURE"),
        ('<Control ID="Own" name="both"><Arm/><Drive/></Control>', "SUCCESS"),
        ('<NonblockingSequence name="both"><Arm/><Drive/></NonblockingSequence>', "SUCCESS"),
    ],
    ids=[
        "success_count is not reached",
        "success_count is in reach",
        "success_count is unknown",
        "ParallelAll",
        "unknown control",
        "NonblockingSequence",
    ],
)
def test_end_with_which_control_need_not_end_stays_in_its_tick(control, status):
    ticks = ticks_of(
        after_battery_check(control),
        f"""
          0: root RUNNING, BatteryOk SUCCESS, both RUNNING, Arm RUNNING, Drive RUNNING, BatteryOk IDLE
        100: BatteryOk SUCCESS, Arm {status}, BatteryOk IDLE
        200: BatteryOk SUCCESS, Drive SUCCESS, Arm IDLE, Drive IDLE, both SUCCESS
        """,
    )
    assert ticks[1:] == [
        f"BatteryOk SUCCESS, Arm {status}, BatteryOk IDLE",
        "BatteryOk SUCCESS, Drive SUCCESS, Arm IDLE, Drive IDLE, both SUCCESS",
    ]


def test_end_after_later_child_was_ticked_belongs_to_next_tick():
    ticks = ticks_of(
        after_battery_check('<Parallel name="all"><Arm/><Drive/><Lamp/></Parallel>'),
        """
          0: root RUNNING, BatteryOk SUCCESS, all RUNNING, Arm RUNNING, Drive RUNNING, Lamp RUNNING, BatteryOk IDLE
        100: BatteryOk SUCCESS, Lamp SUCCESS, Arm SUCCESS, BatteryOk IDLE
        200: BatteryOk SUCCESS, Drive SUCCESS, Arm IDLE, Drive IDLE, Lamp IDLE, all SUCCESS
        """,
    )
    assert ticks[1:] == [
        "BatteryOk SUCCESS, Lamp SUCCESS, BatteryOk IDLE",
        "BatteryOk SUCCESS, Arm SUCCESS, Drive SUCCESS, Arm IDLE, Drive IDLE, Lamp IDLE, all SUCCESS",
    ]


def test_two_ends_between_ticks_do_not_move_to_tick_in_which_third_child_ends():
    ticks = ticks_of(
        after_battery_check('<Parallel name="all"><Arm/><Drive/><Lamp/></Parallel>'),
        """
          0: root RUNNING, BatteryOk SUCCESS, all RUNNING, Arm RUNNING, Drive RUNNING, Lamp RUNNING, BatteryOk IDLE
        140: Lamp SUCCESS
        160: Arm SUCCESS
        200: BatteryOk SUCCESS, BatteryOk IDLE
        300: BatteryOk SUCCESS, Drive SUCCESS, Arm IDLE, Drive IDLE, Lamp IDLE, all SUCCESS
        """,
    )
    assert ticks[-1] == "BatteryOk SUCCESS, Drive SUCCESS, Arm IDLE, Drive IDLE, Lamp IDLE, all SUCCESS"


def test_parallel_processes_ends_of_two_threads_in_order_of_its_children():
    ticks = ticks_of(
        after_battery_check('<Parallel name="all"><Arm/><Drive/><Lamp/></Parallel>'),
        """
          0: root RUNNING, BatteryOk SUCCESS, all RUNNING, Arm RUNNING, Drive RUNNING, Lamp RUNNING, BatteryOk IDLE
        140: Lamp FAILURE
        160: Arm SUCCESS
        200: BatteryOk SUCCESS, Arm IDLE, Drive IDLE, Lamp IDLE, all FAILURE
        """,
    )
    assert ticks[1:] == [
        "BatteryOk SUCCESS, Arm SUCCESS, Lamp FAILURE, Arm IDLE, Drive IDLE, Lamp IDLE, all FAILURE"
    ]


def test_end_stays_in_next_tick_that_has_begun_without_pause():
    ticks = ticks_of(
        '<Parallel name="all"><Arm/><Drive/><Lamp/><Horn/></Parallel>',
        """
          0: all RUNNING, Arm RUNNING, Drive RUNNING, Lamp RUNNING, Horn RUNNING
        100: Lamp SUCCESS, Arm SUCCESS, Drive SUCCESS
        200: Horn SUCCESS, Arm IDLE, Drive IDLE, Lamp IDLE, Horn IDLE, all SUCCESS
        """,
    )
    assert ticks[1:] == [
        "Lamp SUCCESS",
        "Arm SUCCESS, Drive SUCCESS",
        "Horn SUCCESS, Arm IDLE, Drive IDLE, Lamp IDLE, Horn IDLE, all SUCCESS",
    ]


def test_end_while_later_sequence_resets_its_children_belongs_to_next_tick():
    ticks = ticks_of(
        '<Parallel name="all"><Arm/><Sequence name="tour"><Plan/><Drive/></Sequence><Lamp/></Parallel>',
        """
          0: all RUNNING, Arm RUNNING, tour RUNNING, Plan SUCCESS, Drive RUNNING, Lamp RUNNING
        100: Drive SUCCESS, Arm SUCCESS, Plan IDLE, Drive IDLE, tour SUCCESS
        200: Lamp SUCCESS, Arm IDLE, tour IDLE, Lamp IDLE, all SUCCESS
        """,
    )
    assert ticks[1:] == [
        "Drive SUCCESS, Plan IDLE, Drive IDLE, tour SUCCESS",
        "Arm SUCCESS, Lamp SUCCESS, Arm IDLE, tour IDLE, Lamp IDLE, all SUCCESS",
    ]


def test_late_logged_end_stays_if_parallel_ends_because_of_it():
    ticks = ticks_of(
        after_battery_check('<Parallel name="all" success_count="2"><Arm/><Drive/><Lamp/></Parallel>'),
        """
          0: root RUNNING, BatteryOk SUCCESS, all RUNNING, Arm RUNNING, Drive RUNNING, Lamp RUNNING, BatteryOk IDLE
        100: BatteryOk SUCCESS, Lamp SUCCESS, Arm SUCCESS, Arm IDLE, Drive IDLE, Lamp IDLE, all SUCCESS, BatteryOk IDLE, all IDLE
        """,
    )
    assert ticks[1:] == [
        "BatteryOk SUCCESS, Lamp SUCCESS, Arm SUCCESS, Arm IDLE, Drive IDLE, Lamp IDLE, all SUCCESS, BatteryOk IDLE, all IDLE"
    ]


def test_end_is_omitted_if_parallel_halts_leaf_because_later_child_has_failed():
    ticks = ticks_of(
        after_battery_check('<Parallel name="all"><Arm/><Drive/><Lamp/></Parallel>'),
        """
          0: root RUNNING, BatteryOk SUCCESS, all RUNNING, Arm RUNNING, Drive RUNNING, Lamp RUNNING, BatteryOk IDLE
        100: BatteryOk SUCCESS, Lamp FAILURE, Arm SUCCESS, Arm IDLE, Drive IDLE, Lamp IDLE, all FAILURE
        """,
    )
    assert ticks[1:] == ["BatteryOk SUCCESS, Lamp FAILURE, Arm IDLE, Drive IDLE, Lamp IDLE, all FAILURE"]


def test_end_is_omitted_if_program_halts_parallel_before_its_next_tick():
    ticks = ticks_of(
        '<Parallel name="all"><Arm/><Drive/><Lamp/></Parallel>',
        """
          0: all RUNNING, Arm RUNNING, Drive RUNNING, Lamp RUNNING
        100: Lamp SUCCESS, Arm SUCCESS, Arm IDLE, Drive IDLE, Lamp IDLE, all IDLE, all RUNNING, Arm RUNNING, Drive RUNNING, Lamp RUNNING
        """,
    )
    assert ticks[1:] == [
        "Lamp SUCCESS",
        "Arm IDLE, Drive IDLE, Lamp IDLE, all IDLE",
        "all RUNNING, Arm RUNNING, Drive RUNNING, Lamp RUNNING",
    ]


def test_leaf_that_ends_at_once_ends_in_tick_in_which_it_starts():
    ticks = ticks_of(
        '<Parallel name="all"><Arm name="left"/><Arm name="right"/><Lamp/></Parallel>',
        """
          0: all RUNNING, left RUNNING, left SUCCESS, right RUNNING, Lamp RUNNING
        100: Lamp SUCCESS
        200: right SUCCESS, left IDLE, right IDLE, Lamp IDLE, all SUCCESS
        """,
    )
    assert ticks == [
        "all RUNNING, left RUNNING, left SUCCESS, right RUNNING, Lamp RUNNING",
        "Lamp SUCCESS",
        "right SUCCESS, left IDLE, right IDLE, Lamp IDLE, all SUCCESS",
    ]


def test_retry_restarts_leaf_in_tick_in_which_it_processes_end():
    ticks = ticks_of(
        after_battery_check(
            '<RetryUntilSuccessful name="retry" num_attempts="3"><Arm/></RetryUntilSuccessful>'
        ),
        """
          0: root RUNNING, BatteryOk SUCCESS, retry RUNNING, Arm RUNNING, BatteryOk IDLE
        150: Arm FAILURE
        200: BatteryOk SUCCESS, Arm IDLE, Arm RUNNING, BatteryOk IDLE
        """,
    )
    assert ticks[1:] == ["BatteryOk SUCCESS, Arm FAILURE, Arm IDLE, Arm RUNNING, BatteryOk IDLE"]


def test_end_is_not_processed_by_change_of_node_after_sequence():
    ticks = ticks_of(
        '<Parallel name="all"><Sequence name="steps"><Arm/><Drive/></Sequence><Lamp/><Horn/></Parallel>',
        """
          0: all RUNNING, steps RUNNING, Arm RUNNING, Lamp RUNNING, Horn RUNNING
        150: Arm SUCCESS
        160: Lamp SUCCESS
        200: Drive RUNNING
        """,
    )
    assert ticks[1:] == ["Lamp SUCCESS", "Arm SUCCESS, Drive RUNNING"]


def test_if_without_else_ends_without_resetting_its_condition():
    ticks = ticks_of(
        after_battery_check('<IfThenElse name="if"><Arm/><Drive/></IfThenElse>'),
        """
          0: root RUNNING, BatteryOk SUCCESS, if RUNNING, Arm RUNNING, BatteryOk IDLE
        150: Arm FAILURE
        200: BatteryOk SUCCESS, if FAILURE, BatteryOk IDLE, if IDLE, root FAILURE, root IDLE
        """,
    )
    assert ticks[1:] == [
        "BatteryOk SUCCESS, Arm FAILURE, if FAILURE, BatteryOk IDLE, if IDLE, root FAILURE, root IDLE"
    ]


@pytest.mark.parametrize(
    ("children", "condition", "reset"),
    [
        ("<Arm/>", "FAILURE", "LightOk IDLE, Arm IDLE, while FAILURE"),
        ("<Arm/><Wait/>", "FAILURE", "Arm IDLE, Wait RUNNING"),
        ("<Wait/><Arm/>", "SUCCESS", "Arm IDLE, Wait RUNNING"),
    ],
    ids=["without third child", "with third child", "in third child"],
)
def test_end_is_omitted_if_while_halts_leaf_because_condition_changes(children, condition, reset):
    before = "SUCCESS" if condition == "FAILURE" else "FAILURE"
    ticks = ticks_of(
        f'<WhileDoElse name="while"><LightOk/>{children}</WhileDoElse>',
        f"""
          0: while RUNNING, LightOk {before}, Arm RUNNING
        150: Arm SUCCESS
        200: LightOk {condition}, {reset}
        """,
    )
    assert ticks[1:] == [f"LightOk {condition}, {reset}"]


def test_while_processes_end_of_its_condition_before_it_halts_other_child():
    # Actions of Nav2 that have failed are started again without a reset.
    ticks = ticks_of(
        after_battery_check('<WhileDoElse name="while"><Arm/><Drive/><Lamp/></WhileDoElse>'),
        """
          0: root RUNNING, BatteryOk SUCCESS, while RUNNING, Arm RUNNING, BatteryOk IDLE
        100: BatteryOk SUCCESS, Arm FAILURE, Lamp RUNNING, BatteryOk IDLE
        200: BatteryOk SUCCESS, Arm RUNNING, BatteryOk IDLE
        250: Arm SUCCESS
        300: BatteryOk SUCCESS, Lamp IDLE, Drive RUNNING, BatteryOk IDLE
        """,
    )
    assert ticks[3:] == ["BatteryOk SUCCESS, Arm SUCCESS, Lamp IDLE, Drive RUNNING, BatteryOk IDLE"]


@pytest.mark.parametrize("catch", ["false", "true"])
def test_try_catch_ticks_last_child_in_tick_in_which_it_processes_failure(catch):
    ticks = ticks_of(
        after_battery_check(f'<TryCatch name="try" catch_on_halt="{catch}"><Arm/><Clean/></TryCatch>'),
        """
          0: root RUNNING, BatteryOk SUCCESS, try RUNNING, Arm RUNNING, BatteryOk IDLE
        150: Arm FAILURE
        200: BatteryOk SUCCESS, Arm IDLE, Clean RUNNING, BatteryOk IDLE
        300: BatteryOk SUCCESS, Clean SUCCESS, Clean IDLE, try FAILURE
        """,
    )
    assert ticks[1:] == [
        "BatteryOk SUCCESS, Arm FAILURE, Arm IDLE, Clean RUNNING, BatteryOk IDLE",
        "BatteryOk SUCCESS, Clean SUCCESS, Clean IDLE, try FAILURE",
    ]


@pytest.mark.parametrize("catch", ["false", "true"])
def test_try_catch_ends_in_tick_in_which_it_processes_failure(catch):
    last = "BatteryOk SUCCESS, {}Arm IDLE, Clean RUNNING, Clean SUCCESS, Clean IDLE, try FAILURE, BatteryOk IDLE, try IDLE, root FAILURE, root IDLE"
    ticks = ticks_of(
        after_battery_check(f'<TryCatch name="try" catch_on_halt="{catch}"><Arm/><Clean/></TryCatch>'),
        f"""
          0: root RUNNING, BatteryOk SUCCESS, try RUNNING, Arm RUNNING, BatteryOk IDLE
        150: Arm FAILURE
        200: {last.format("")}
        """,
    )
    assert ticks[1:] == [last.format("Arm FAILURE, ")]


def test_end_is_omitted_if_try_catch_is_halted():
    last = "BatteryOk FAILURE, BatteryOk IDLE, Arm IDLE, Clean RUNNING, Clean SUCCESS, Clean IDLE, try IDLE, root FAILURE, root IDLE"
    ticks = ticks_of(
        after_battery_check('<TryCatch name="try" catch_on_halt="true"><Arm/><Clean/></TryCatch>'),
        f"""
          0: root RUNNING, BatteryOk SUCCESS, try RUNNING, Arm RUNNING, BatteryOk IDLE
        150: Arm FAILURE
        200: {last}
        """,
    )
    assert ticks[1:] == [last]


def test_end_is_omitted_if_sequence_is_halted():
    last = "BatteryOk FAILURE, BatteryOk IDLE, Plan IDLE, Arm IDLE, steps IDLE, root FAILURE, root IDLE"
    ticks = ticks_of(
        after_battery_check('<Sequence name="steps"><Plan/><Arm/><Drive/></Sequence>'),
        f"""
          0: root RUNNING, BatteryOk SUCCESS, steps RUNNING, Plan SUCCESS, Arm RUNNING, BatteryOk IDLE
        150: Arm SUCCESS
        200: {last}
        """,
    )
    assert ticks[1:] == [last]


def test_recovery_node_continues_with_first_child_after_end_of_recovery():
    last = "BatteryOk SUCCESS, {}Clear IDLE, Drive RUNNING, BatteryOk IDLE"
    ticks = ticks_of(
        after_battery_check('<RecoveryNode name="recovery"><Drive/><Clear/></RecoveryNode>'),
        f"""
          0: root RUNNING, BatteryOk SUCCESS, recovery RUNNING, Drive RUNNING, BatteryOk IDLE
        100: BatteryOk SUCCESS, Drive FAILURE, Drive IDLE, Clear RUNNING, BatteryOk IDLE
        150: Clear SUCCESS
        200: {last.format("")}
        """,
    )
    assert ticks[2:] == [last.format("Clear SUCCESS, ")]


def test_recovery_node_resets_itself_before_it_ends():
    last = "BatteryOk SUCCESS, {}Drive IDLE, recovery IDLE, recovery SUCCESS, BatteryOk IDLE, recovery IDLE, root SUCCESS, root IDLE"
    ticks = ticks_of(
        after_battery_check('<RecoveryNode name="recovery"><Drive/><Clear/></RecoveryNode>'),
        f"""
          0: root RUNNING, BatteryOk SUCCESS, recovery RUNNING, Drive RUNNING, BatteryOk IDLE
        150: Drive SUCCESS
        200: {last.format("")}
        """,
    )
    assert ticks[1:] == [last.format("Drive SUCCESS, ")]


def test_end_is_omitted_if_program_halts_sequence():
    ticks = ticks_of(
        '<Sequence name="steps"><Arm/><Drive/></Sequence>',
        """
          0: steps RUNNING, Arm RUNNING, Arm SUCCESS, Drive RUNNING, Drive SUCCESS, Arm IDLE, Drive IDLE, steps SUCCESS, steps IDLE
        100: steps RUNNING, Arm RUNNING
        150: Arm SUCCESS
        200: Arm IDLE, steps IDLE
        """,
    )
    assert ticks[-1] == "Arm IDLE, steps IDLE"
    assert "Arm SUCCESS" not in ticks[-2]


def test_end_that_no_parent_processes_before_end_of_log_is_kept():
    ticks = ticks_of(
        after_battery_check('<Sequence name="steps"><Arm/><Drive/></Sequence>'),
        """
          0: root RUNNING, BatteryOk SUCCESS, steps RUNNING, Arm RUNNING, BatteryOk IDLE
        150: Arm SUCCESS
        200: BatteryOk SUCCESS
        """,
    )
    assert ticks[1:] == ["Arm SUCCESS, BatteryOk SUCCESS"]


@pytest.mark.parametrize(
    ("control", "last"),
    [
        ('<Sequence name="both"><Arm/><Drive/></Sequence>', "Arm IDLE"),
        ('<TryCatch name="both" catch_on_halt="true"><Arm/><Clean/></TryCatch>', "Arm IDLE, Clean RUNNING"),
    ],
    ids=["Sequence", "TryCatch"],
)
def test_log_may_end_while_control_resets_its_children(control, last):
    ticks = ticks_of(
        after_battery_check(control),
        f"""
          0: root RUNNING, BatteryOk SUCCESS, both RUNNING, Arm RUNNING, BatteryOk IDLE
        150: Arm FAILURE
        200: BatteryOk SUCCESS, {last}
        """,
    )
    assert ticks[-1].endswith(last)


def test_end_of_pipeline_child_stays_in_its_tick_while_later_child_runs():
    # Actions of Nav2 that have succeeded are started again without a reset.
    ticks = ticks_of(
        after_battery_check('<PipelineSequence name="pipeline"><Plan/><Drive/></PipelineSequence>'),
        """
          0: root RUNNING, BatteryOk SUCCESS, Plan RUNNING, pipeline RUNNING, BatteryOk IDLE
        100: BatteryOk SUCCESS, Plan SUCCESS, Drive RUNNING, BatteryOk IDLE
        200: BatteryOk SUCCESS, Plan RUNNING, BatteryOk IDLE
        300: BatteryOk SUCCESS, Plan SUCCESS, BatteryOk IDLE
        400: BatteryOk SUCCESS, Plan RUNNING, BatteryOk IDLE
        """,
    )
    assert ticks[3:] == [
        "BatteryOk SUCCESS, Plan SUCCESS, BatteryOk IDLE",
        "BatteryOk SUCCESS, Plan RUNNING, BatteryOk IDLE",
    ]


def test_end_before_later_control_ends_belongs_to_next_tick():
    ticks = ticks_of(
        '<Parallel name="all" success_count="2" failure_count="2"><Arm/><IfThenElse name="if"><Door/><Open/></IfThenElse><Lamp/></Parallel>',
        """
          0: all RUNNING, Arm RUNNING, if RUNNING, Door RUNNING, Lamp RUNNING
        100: Door FAILURE, Arm SUCCESS, if FAILURE
        200: Lamp SUCCESS, Arm IDLE, if IDLE, Lamp IDLE, all SUCCESS
        """,
    )
    assert ticks[1:] == [
        "Door FAILURE, if FAILURE",
        "Arm SUCCESS, Lamp SUCCESS, Arm IDLE, if IDLE, Lamp IDLE, all SUCCESS",
    ]


def test_leaf_that_never_lasts_starts_and_ends_in_one_tick():
    ticks = ticks_of(
        '<Sequence name="steps"><Plan/><Drive/></Sequence>',
        "0: steps RUNNING, Plan RUNNING, Plan SUCCESS, Drive RUNNING",
    )
    assert ticks == ["steps RUNNING, Plan RUNNING, Plan SUCCESS, Drive RUNNING"]


def test_leaf_that_lasts_elsewhere_ends_in_tick_after_its_start():
    ticks = ticks_of(
        '<Parallel name="all"><Drive name="far"/><Sequence name="steps"><Drive name="near"/><Lamp/></Sequence></Parallel>',
        "0: all RUNNING, far RUNNING, steps RUNNING, near RUNNING, near SUCCESS, Lamp RUNNING",
    )
    assert ticks == ["all RUNNING, far RUNNING, steps RUNNING, near RUNNING", "near SUCCESS, Lamp RUNNING"]


def test_end_of_later_child_is_ignored_if_earlier_child_has_decided_parallel():
    ticks = ticks_of(
        '<Parallel name="root" success_count="2"><Parallel name="both" success_count="1"><Arm/><Drive/></Parallel><Look/></Parallel>',
        """
          0: root RUNNING, both RUNNING, Arm RUNNING, Drive RUNNING, Arm SUCCESS, Look RUNNING
        150: Drive SUCCESS
        200: Arm IDLE, Drive IDLE, both SUCCESS
        """,
    )
    assert ticks == [
        "root RUNNING, both RUNNING, Arm RUNNING, Drive RUNNING, Look RUNNING",
        "Arm SUCCESS, Arm IDLE, Drive IDLE, both SUCCESS",
    ]


def test_end_of_another_thread_may_be_logged_between_reset_and_end_of_parent():
    ticks = ticks_of(
        '<Parallel name="root" success_count="3"><Lift/>'
        '<WhileDoElse name="while"><LightOk/><Drive/><Lamp/></WhileDoElse><Look/></Parallel>',
        """
          0: root RUNNING, Lift RUNNING, while RUNNING, LightOk SUCCESS, Drive RUNNING, Look RUNNING
        150: Drive SUCCESS
        200: LightOk IDLE, Lift SUCCESS, Drive IDLE, while SUCCESS
        300: Look SUCCESS, Lift IDLE, while IDLE, Look IDLE, root SUCCESS
        """,
    )
    assert "Drive SUCCESS, LightOk IDLE" in " | ".join(ticks)
