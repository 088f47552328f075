"""Tests of scripted runs: a scenario decides which outcome each leaf returns, and when."""

from dataclasses import replace

import pytest

from sar_compiler.analysis.simulate.scenario_run import ScenarioPlayer, failures
from tests.analysis.simulate.stage import PATROL, answers, played, read, stage

DRIVE = "<NavigateToZone/>"
FOUR = "until: tick == 4\nleaves:\n  NavigateToZone: "


def outcomes_of_drives(script):
    return answers(played(FOUR + script, DRIVE), "NavigateToZone")


def test_unscripted_leaf_returns_usual_outcome():
    assert outcomes_of_drives("[]") == ["arrived"] * 4


def test_single_outcome_is_always_returned():
    assert outcomes_of_drives("aborted") == ["aborted"] * 4


def test_list_of_outcomes_is_followed_by_usual_outcome():
    assert outcomes_of_drives("[aborted, aborted]") == ["aborted", "aborted", "arrived", "arrived"]


def test_status_selects_first_outcome_with_it():
    assert outcomes_of_drives("[FAILURE, RUNNING, SUCCESS, aborted]") == [
        "aborted",
        "driving",
        "arrived",
        "aborted",
    ]


def test_delayed_outcome_is_returned_at_first_tick_after_delay():
    assert outcomes_of_drives("[{outcome: aborted, after: 0.6s}]") == [
        "driving",
        "driving",
        "aborted",
        "arrived",
    ]


def test_scenario_sets_tick_period():
    text = f"period: 0.1s\n{FOUR}[{{outcome: aborted, after: 0.3s}}]"
    run = played(text, DRIVE)
    assert answers(run, "NavigateToZone") == ["driving"] * 3 + ["aborted"]
    assert [tick.time_sec for tick in run.ticks] == [0.0, 0.1, 0.2, 0.3]


def test_running_alone_runs_forever():
    assert outcomes_of_drives("RUNNING") == ["driving"] * 4


def test_outcome_can_be_repeated_several_times_or_always():
    assert outcomes_of_drives("[{outcome: aborted, times: 2}, arrived]") == [
        "aborted",
        "aborted",
        "arrived",
        "arrived",
    ]
    assert outcomes_of_drives("[arrived, {outcome: aborted, times: always}]") == ["arrived"] + ["aborted"] * 3


def test_outcome_can_be_returned_every_nth_time():
    assert outcomes_of_drives("{outcome: aborted, every: 2}") == ["arrived", "aborted", "arrived", "aborted"]


def test_every_nth_step_is_used_up_only_after_given_times():
    always = "{outcome: arrived, times: always}"
    assert outcomes_of_drives(f"[{{outcome: aborted, every: 2}}, {always}]") == ["arrived", "aborted"] * 2
    assert outcomes_of_drives(f"[{{outcome: aborted, every: 2, times: 1}}, {always}]") == [
        "arrived",
        "aborted",
        "arrived",
        "arrived",
    ]


def test_outcome_can_depend_on_facts_and_run():
    text = """
    until: "zones_left == 0"
    leaves:
      NavigateToZone: {outcome: aborted, when: "zones_left == 2 && tick < 4 && time > 0 && root == 'SUCCESS'"}
    """
    run = played(text, "<Sequence><NavigateToZone/><AdvanceZone/></Sequence>")
    assert answers(run, "NavigateToZone") == ["arrived", "aborted", "arrived", "arrived"]


def test_step_with_false_condition_leaves_turn_to_next():
    assert outcomes_of_drives('[{outcome: aborted, when: "tick == 2"}, RUNNING]') == [
        "driving",
        "aborted",
        "arrived",
        "arrived",
    ]


def test_halted_leaf_has_used_its_step():
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


def test_halt_by_tree_is_recorded():
    text = """
    ticks: 3
    leaves: {NavigateToZone: [aborted, RUNNING], NavigateToBase: RUNNING}
    """
    run = played(text)
    assert answers(run, "NavigateToBase") == ["driving", "halted"]


def test_path_takes_precedence_over_name_and_name_over_tag():
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


def test_label_can_contain_spaces():
    text = "leaves: {DetectSurvivor: no answer, NavigateToBase: RUNNING}\nticks: 1"
    assert answers(played(text), "DetectSurvivor") == ["no answer"]


def test_run_ends_when_root_succeeds_or_fails():
    run = played("leaves: {NavigateToZone: {outcome: arrived, after: 1s}}")
    assert (run.ended, run.root, len(run.ticks)) == (True, "SUCCESS", 3)


def test_run_with_skipped_root_has_not_ended():
    run = played("ticks: 3", '<RunOnce then_skip="true"><NavigateToZone _skipIf="true"/></RunOnce>')
    assert ([tick.root for tick in run.ticks], run.ended) == (["SKIPPED"] * 3, False)


def test_run_ends_when_until_condition_is_true():
    run = played("until: \"zones_left == 0 && at == 'base'\"", PATROL)
    assert (run.ended, len(run.ticks), run.simulated.fact_values()["at"]) == (True, 4, "base")


def test_run_without_end_stops_after_given_ticks():
    run = played("ticks: 7\nleaves: {NavigateToZone: RUNNING}")
    assert (run.ended, run.root, len(run.ticks)) == (False, "RUNNING", 7)


def test_skipped_root_has_status_skipped():
    assert played("expect: {root: SKIPPED}", '<AdvanceZone _skipIf="true"/>').root == "SKIPPED"


def test_tick_records_changed_facts_and_keys():
    body = '<Sequence><Script code="count := 1"/><AdvanceZone/><UnsetBlackboard key="speed"/></Sequence>'
    (tick,) = played("parameters: {speed: 2}", body).ticks
    assert (tick.facts, tick.keys) == (
        {"zones_left": (3, 2)},
        {"count": (None, 1), "speed": (2, None)},
    )


def test_mission_parameters_come_from_scenario():
    body = '<Timeout duration="{@patience}"><NavigateToZone/></Timeout>'
    run = played("parameters: {patience: 1.0}\nleaves: {NavigateToZone: RUNNING}", body)
    assert (run.root, run.time_sec) == ("FAILURE", 1.0)


def test_outcomes_of_scenario_replace_declared_ones():
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
def test_impossible_step_aborts_run_and_is_only_failure(text, body, message):
    run = played(f"{text}\nexpect: {{root: RUNNING}}", body)
    (failure,) = failures(run)
    assert failure.expected == "run"
    assert failure.message.startswith("an error occurred in tick 1: ")
    assert message in failure.message


def test_exception_in_node_aborts_run(monkeypatch):
    play = read("name: x", DRIVE)
    monkeypatch.setattr(play.simulated.leaves[0], "initialise", lambda: 1 / 0)
    run = ScenarioPlayer(play.simulated, play.scenario).run_to_end()
    assert run.trouble == "ZeroDivisionError: division by zero"


def test_stage_can_play_several_scenarios():
    here = stage()
    runs = [ScenarioPlayer(play.simulated, play.scenario).run_to_end() for play in (here.play(), here.play())]
    assert [run.simulated.fact_values()["zones_left"] for run in runs] == [2, 2]


def random_run(script, seed=0, ticks=200):
    play = read(f"until: tick == {ticks}\nleaves:\n  NavigateToZone: {script}", DRIVE)
    return ScenarioPlayer(play.simulated, replace(play.scenario, seed=seed)).run_to_end()


def test_step_with_probability_falls_through_to_next_step():
    script = "[{outcome: aborted, probability: 0.25, times: always}, {outcome: arrived, times: always}]"
    said = answers(random_run(script, ticks=400), "NavigateToZone")
    assert set(said) == {"aborted", "arrived"}
    assert 70 <= said.count("aborted") <= 130


def test_same_seed_gives_same_run_and_other_seed_gives_other_run():
    script = "{outcome: aborted, probability: 0.5}"
    runs = [answers(random_run(script, seed), "NavigateToZone") for seed in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]


def test_duration_interval_is_sampled_each_time():
    run = random_run("[{outcome: aborted, after: 1s to 3s, times: always}]", ticks=300)
    said = "".join("." if each == "driving" else "!" for each in answers(run, "NavigateToZone"))
    lengths = {len(part) for part in said.split("!")[:-1]}
    assert lengths == {3, 4, 5, 6}


def test_chosen_outcomes_are_recorded_with_whether_they_are_usual():
    play = read(
        "until: tick == 3\nleaves:\n  NavigateToZone: [aborted, {outcome: arrived, after: 9s}]", DRIVE
    )
    player = ScenarioPlayer(play.simulated, play.scenario)
    player.run_to_end()
    assert [each[1:] for each in player.scripted.choices] == [("aborted", 0.0, False), ("arrived", 9.0, True)]


def test_unscripted_leaf_can_return_unusual_outcomes():
    play = read("until: tick == 400", DRIVE)
    run = ScenarioPlayer(play.simulated, replace(play.scenario, unusual=0.25)).run_to_end()
    said = answers(run, "NavigateToZone")
    assert set(said) == {"arrived", "aborted", "unavailable"}
    assert 70 <= said.count("aborted") + said.count("unavailable") <= 130
