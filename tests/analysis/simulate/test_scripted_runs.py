"""What leaves answer, and when, as a scenario says."""

from dataclasses import replace

import pytest

from sar_compiler.analysis.simulate.scenario_run import ScenarioPlayer, failures
from tests.analysis.simulate.stage import PATROL, answers, played, read, stage

DRIVE = "<NavigateToZone/>"
FOUR = "until: tick == 4\nleaves:\n  NavigateToZone: "


def drives(script):
    return answers(played(FOUR + script, DRIVE), "NavigateToZone")


def test_a_leaf_of_which_nothing_is_said_answers_what_is_usual():
    assert drives("[]") == ["arrived"] * 4


def test_a_single_answer_is_given_always():
    assert drives("aborted") == ["aborted"] * 4


def test_answers_of_a_list_are_given_one_after_the_other_and_then_what_is_usual():
    assert drives("[aborted, aborted]") == ["aborted", "aborted", "arrived", "arrived"]


def test_a_status_is_the_first_answer_that_has_it():
    assert drives("[FAILURE, RUNNING, SUCCESS, aborted]") == ["aborted", "driving", "arrived", "aborted"]


def test_an_answer_after_a_time_comes_at_the_first_tick_when_the_time_is_over():
    assert drives("[{outcome: aborted, after: 0.6s}]") == ["driving", "driving", "aborted", "arrived"]


def test_the_period_is_that_of_the_scenario():
    text = f"period: 0.1s\n{FOUR}[{{outcome: aborted, after: 0.3s}}]"
    run = played(text, DRIVE)
    assert answers(run, "NavigateToZone") == ["driving"] * 3 + ["aborted"]
    assert [tick.time_sec for tick in run.ticks] == [0.0, 0.1, 0.2, 0.3]


def test_running_alone_is_running_for_ever():
    assert drives("RUNNING") == ["driving"] * 4


def test_an_answer_may_be_given_several_times_or_always():
    assert drives("[{outcome: aborted, times: 2}, arrived]") == ["aborted", "aborted", "arrived", "arrived"]
    assert drives("[arrived, {outcome: aborted, times: always}]") == ["arrived"] + ["aborted"] * 3


def test_an_answer_may_be_given_every_so_many_times():
    assert drives("{outcome: aborted, every: 2}") == ["arrived", "aborted", "arrived", "aborted"]


def test_every_so_many_times_is_not_used_up_in_a_list_unless_it_says_how_often():
    always = "{outcome: arrived, times: always}"
    assert drives(f"[{{outcome: aborted, every: 2}}, {always}]") == ["arrived", "aborted"] * 2
    assert drives(f"[{{outcome: aborted, every: 2, times: 1}}, {always}]") == [
        "arrived",
        "aborted",
        "arrived",
        "arrived",
    ]


def test_an_answer_may_depend_on_facts_and_on_the_run_itself():
    text = """
    until: "zones_left == 0"
    leaves:
      NavigateToZone: {outcome: aborted, when: "zones_left == 2 && tick < 4 && time > 0 && root == 'SUCCESS'"}
    """
    run = played(text, "<Sequence><NavigateToZone/><AdvanceZone/></Sequence>")
    assert answers(run, "NavigateToZone") == ["arrived", "aborted", "arrived", "arrived"]


def test_a_step_whose_condition_is_false_leaves_its_turn_to_the_next():
    assert drives('[{outcome: aborted, when: "tick == 2"}, RUNNING]') == [
        "driving",
        "aborted",
        "arrived",
        "arrived",
    ]


def test_a_leaf_that_is_halted_has_had_its_turn():
    text = """
    until: tick == 4
    leaves:
      NavigateToZone: [{outcome: arrived, after: 10s}, aborted]
    """
    body = '<Sequence memory="false"><ScriptCondition code="a := 1; 1"/><NavigateToZone/></Sequence>'
    play = read(text, body)
    simulation = ScenarioPlayer(play.simulated, play.scenario)
    simulation.tick()
    play.simulated.root.stop(play.simulated.root.status.INVALID)
    simulation.tick()
    assert answers(simulation.run, "NavigateToZone") == ["driving", "aborted"]


def test_a_leaf_that_the_tree_halts_says_so():
    text = """
    ticks: 3
    leaves: {NavigateToZone: [aborted, RUNNING], NavigateToBase: RUNNING}
    """
    run = played(text)
    assert answers(run, "NavigateToBase") == ["driving", "halted"]


def test_a_path_counts_before_a_name_and_a_name_before_a_tag():
    body = """<Sequence>
      <NavigateToZone name="First"/><Sequence name="In"><NavigateToZone name="Second"/></Sequence>
      <NavigateToZone name="Third"/></Sequence>"""
    text = """
    leaves:
      In/NavigateToZone: {outcome: arrived, after: 1s}
      NavigateToZone: aborted
      First: arrived
      Second: aborted
    """
    run = played(text, body)
    seen = {name: answers(run, name)[-1] for name in ("First", "Second", "Third")}
    assert seen == {"First": "arrived", "Second": "arrived", "Third": "aborted"}


def test_a_label_may_have_blanks():
    text = "leaves: {DetectSurvivor: no answer, NavigateToBase: RUNNING}\nticks: 1"
    assert answers(played(text), "DetectSurvivor") == ["no answer"]


def test_a_run_ends_when_the_root_has_succeeded_or_failed():
    run = played("leaves: {NavigateToZone: {outcome: arrived, after: 1s}}")
    assert (run.ended, run.root, len(run.ticks)) == (True, "SUCCESS", 3)


def test_a_root_that_is_skipped_has_not_ended():
    run = played("ticks: 3", '<RunOnce then_skip="true"><NavigateToZone _skipIf="true"/></RunOnce>')
    assert ([tick.root for tick in run.ticks], run.ended) == (["SKIPPED"] * 3, False)


def test_a_run_ends_when_its_condition_is_true():
    run = played("until: \"zones_left == 0 && at == 'base'\"", PATROL)
    assert (run.ended, len(run.ticks), run.simulated.fact_values()["at"]) == (True, 4, "base")


def test_a_run_without_an_end_is_broken_off():
    run = played("ticks: 7\nleaves: {NavigateToZone: RUNNING}")
    assert (run.ended, run.root, len(run.ticks)) == (False, "RUNNING", 7)


def test_a_root_that_is_skipped_has_come_to_that():
    assert played("expect: {root: SKIPPED}", '<AdvanceZone _skipIf="true"/>').root == "SKIPPED"


def test_a_tick_knows_which_facts_and_keys_it_has_changed():
    body = '<Sequence><Script code="count := 1"/><AdvanceZone/><UnsetBlackboard key="speed"/></Sequence>'
    (tick,) = played("parameters: {speed: 2}", body).ticks
    assert (tick.facts, tick.keys) == (
        {"zones_left": (3, 2)},
        {"count": (None, 1), "speed": (2, None)},
    )


def test_parameters_of_the_mission_are_those_of_the_scenario():
    body = '<Timeout duration="{@patience}"><NavigateToZone/></Timeout>'
    run = played("parameters: {patience: 1.0}\nleaves: {NavigateToZone: RUNNING}", body)
    assert (run.root, run.time_sec) == ("FAILURE", 1.0)


def test_answers_of_the_scenario_take_the_place_of_those_that_the_leaf_declares():
    text = """
    facts: {battery: 2}
    outcomes:
      NavigateToZone:
        - {status: FAILURE, label: flat, when: "battery == 0"}
        - {status: RUNNING, label: rolling, then: "battery -= 1"}
    """
    run = played(text, DRIVE)
    assert answers(run, "NavigateToZone") == ["rolling", "rolling", "flat"]


@pytest.mark.parametrize(
    ("text", "body", "message"),
    [
        (
            "facts: {zones_left: 0}\nleaves: {DetectSurvivor: found}",
            "<DetectSurvivor/>",
            "'DetectSurvivor' cannot return 'found' here, because 'found' requires zones_left > 0. It can return no zone",
        ),
        (
            'leaves: {AdvanceZone: {outcome: advanced, when: "zone_left > 1"}}',
            '<Sequence><AdvanceZone/><Script code="{program}"/></Sequence>',
            "did you mean 'zones_left'?",
        ),
        ("until: zones_left", "<AdvanceZone/>", "until 'zones_left': 'zones_left' is not a condition"),
        ("facts: {zones_left: -1}", "<ZonesRemaining/>", "has no possible outcome now"),
        ("name: a key", '<Script code="a = 1"/>', "there is no variable 'a'"),
    ],
)
def test_what_cannot_be_breaks_the_run_off_and_is_the_only_failure(text, body, message):
    run = played(f"{text}\nexpect: {{root: RUNNING}}", body)
    (failure,) = failures(run)
    assert failure.expected == "run"
    assert failure.message.startswith("an error occurred in tick 1: ")
    assert message in failure.message


def test_a_node_that_raises_something_of_its_own_breaks_the_run_off(monkeypatch):
    play = read("name: x", DRIVE)
    monkeypatch.setattr(play.simulated.leaves[0], "initialise", lambda: 1 / 0)
    run = ScenarioPlayer(play.simulated, play.scenario).run_to_end()
    assert run.trouble == "ZeroDivisionError: division by zero"


def test_the_same_stage_plays_any_number_of_scenarios():
    here = stage()
    runs = [ScenarioPlayer(play.simulated, play.scenario).run_to_end() for play in (here.play(), here.play())]
    assert [run.simulated.fact_values()["zones_left"] for run in runs] == [2, 2]


def by_chance(script, seed=0, ticks=200):
    play = read(f"until: tick == {ticks}\nleaves:\n  NavigateToZone: {script}", DRIVE)
    return ScenarioPlayer(play.simulated, replace(play.scenario, seed=seed)).run_to_end()


def test_a_step_with_a_chance_is_taken_now_and_then_and_else_the_next_one():
    script = "[{outcome: aborted, probability: 0.25, times: always}, {outcome: arrived, times: always}]"
    said = answers(by_chance(script, ticks=400), "NavigateToZone")
    assert set(said) == {"aborted", "arrived"}
    assert 70 <= said.count("aborted") <= 130


def test_the_same_seed_gives_the_same_run_and_another_one_another():
    script = "{outcome: aborted, probability: 0.5}"
    runs = [answers(by_chance(script, seed), "NavigateToZone") for seed in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]


def test_a_time_between_two_durations_is_another_one_each_time():
    run = by_chance("[{outcome: aborted, after: 1s to 3s, times: always}]", ticks=300)
    said = "".join("." if each == "driving" else "!" for each in answers(run, "NavigateToZone"))
    lengths = {len(part) for part in said.split("!")[:-1]}
    assert lengths == {3, 4, 5, 6}


def test_what_was_chosen_is_kept_with_whether_it_is_usual():
    play = read(
        "until: tick == 3\nleaves:\n  NavigateToZone: [aborted, {outcome: arrived, after: 9s}]", DRIVE
    )
    player = ScenarioPlayer(play.simulated, play.scenario)
    player.run_to_end()
    assert [each[1:] for each in player.scripted.choices] == [("aborted", 0.0, False), ("arrived", 9.0, True)]


def test_a_leaf_of_which_nothing_is_said_may_answer_what_is_not_usual():
    play = read("until: tick == 400", DRIVE)
    run = ScenarioPlayer(play.simulated, replace(play.scenario, unusual=0.25)).run_to_end()
    said = answers(run, "NavigateToZone")
    assert set(said) == {"arrived", "aborted", "unavailable"}
    assert 70 <= said.count("aborted") + said.count("unavailable") <= 130
