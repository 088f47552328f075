"""Tests of `sar-compile predict`."""

import json
import re

import pytest

from tests.cli.command_runner import run

TREE = """<root BTCPP_format="4"><BehaviorTree ID="Tree">
  <Repeat num_success="9"><DetectSurvivor/></Repeat>
</BehaviorTree></root>
"""
PROBABILITIES = """
outcomes:
  DetectSurvivor: [{{outcome: found, p: 0}}, {{outcome: nothing, p: {nothing}, sec: {sec}}}, {{outcome: no answer}}]
properties:
  always an outcome: {{never: DetectSurvivor no answer}}
"""


@pytest.fixture
def predict(tmp_path, capsys):
    def predict(*arguments, nothing=0.9, sec=1):
        (tmp_path / "tree.xml").write_text(TREE, encoding="utf-8")
        (tmp_path / "p.yaml").write_text(PROBABILITIES.format(nothing=nothing, sec=sec), encoding="utf-8")
        words = [word.format(folder=tmp_path) for word in arguments]
        return run(capsys, "predict", tmp_path / "tree.xml", "--properties", tmp_path / "p.yaml", *words)

    return predict


def test_probabilities_and_times_are_printed_line_by_line(predict):
    status, out, err = predict()
    assert (status, err) == (0, "")
    lines = out.splitlines()
    assert re.fullmatch(r"\d+ states, \d+ steps between them, \d+\.\d s", lines[0])
    assert "  success:           38.7 %" in lines
    assert "  always an outcome: 38.7 %" in lines
    # Repeat continues in the next tick, half a second later.
    assert "  time to success:   13.0 s" in lines


def test_json_output_has_both_bounds(predict):
    status, out, _ = predict("--format", "json", nothing=[0.8, 0.9])
    told = json.loads(out)
    assert status == 0
    assert told["success"] == pytest.approx({"low": 0.8**9, "high": 0.9**9})
    assert told["properties"]["always an outcome"] == pytest.approx(told["success"])
    assert (told["complete"], told["unknown"]) == (True, [])


def test_period_option_sets_tick_period(predict):
    times = [
        json.loads(predict("--period", sec, "--format", "json")[1])["success_sec"] for sec in ("1", "0.25")
    ]
    assert [each["low"] for each in times] == pytest.approx([9 * 1 + 8 * 1, 9 * 1 + 8 * 0.25])


def test_plot_has_both_curves_and_round_seconds(predict, tmp_path):
    assert predict("--plot", "{folder}/plot.svg")[0] == 0
    picture = (tmp_path / "plot.svg").read_text(encoding="utf-8")
    assert all(f'<path class="{each}"' in picture for each in ("ended", "succeeded"))
    assert re.findall(r'text-anchor="middle">([\d.]+)<', picture) == ["0", "2", "4", "6", "8", "10", "12"]


def test_plot_without_end_times_is_not_written_and_reported(predict, tmp_path):
    status, out, err = predict("--plot", "{folder}/plot.svg", "--max-states", "3")
    assert status == 1
    assert "Not all states were explored" in out
    assert err.endswith("plot.svg was not written, because no run ends or the end times were not computed\n")
    assert not (tmp_path / "plot.svg").exists()


def test_reversed_probability_interval_is_reported_with_location(predict):
    status, _, err = predict(nothing=[0.9, 0.8])
    assert status == 1
    assert "p.yaml:3:" in err
    assert "the lower number of an interval must come first" in err


def test_duration_of_too_many_ticks_is_rejected_with_suggested_period(predict, monkeypatch):
    monkeypatch.setattr("sar_compiler.analysis.predict._MOST_TICKS", 20)
    status, out, err = predict("--period", "1", sec=30)
    assert (status, out) == (1, "")
    assert err == (
        "sar-compile: no prediction is possible: 'DetectSurvivor' takes 30 s, which is 30 ticks. At most 20 ticks are supported. "
        "Use a longer tick period: --period 1.5\n"
    )
    assert predict("--period", "1.5", sec=30)[0] == 0
    with pytest.raises(SystemExit):
        predict("--period", "1e-300")
