"""Tests of `sar-run --report`: the reports at the end of a run, and rejected arguments."""

import json
import re

import geojson
import pytest

from tests.trees import document

pytestmark = pytest.mark.ros

GEO = ("-p", "georeference.lat:=48.2", "-p", "georeference.lon:=16.37", "-p", "georeference.heading:=90.0")


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document('<AlwaysFailure name="Nothing"/>'), encoding="utf-8")
    return path


def test_report_has_map_path_and_survivors(start, tmp_path):
    out = [tmp_path / f"report.{form}" for form in ("html", "json", "geojson", "cot", "cap")]
    asked = [word for file in out for word in ("--report", file)]
    run = start("sar-run", "--sim", "--speed", "20", *asked, "--ros-args", "-p", "zone_order:=[zone_a]", *GEO)
    assert run.end() == 0, run.output
    data = json.loads(out[1].read_text(encoding="utf-8"))
    (survivor,) = data["landmarks"]["survivors"]
    assert (survivor["name"], survivor["within"], survivor["report"]) == (
        "survivor_1",
        "zone_a",
        "acknowledged",
    )
    assert (data["outcome"], data["simulated"]) == ("complete", True)
    assert data["landmarks"]["base"][0]["state"] == "home"
    assert data["facts"][-1]["text"] == "reached the base station"
    assert len(data["path"]) > 3
    assert 'href="data:image/png;base64,' in out[0].read_text(encoding="utf-8")
    assert geojson.loads(out[2].read_text(encoding="utf-8")).is_valid
    assert "survivor_1" in out[3].read_text(encoding="utf-8")
    assert "<status>Exercise</status>" in out[4].read_text(encoding="utf-8")


def test_failed_run_is_reported(start, tree, tmp_path):
    assert start("sar-run", tree, "--report", tmp_path / "r.json").end() == 1
    data = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert (data["outcome"], data["why"]["causes"][0]["name"]) == ("failed", "Nothing")
    assert [(node["name"], node["status"], node["line"]) for node in data["tree"]] == [
        ("Nothing", "FAILURE", 3)
    ]


def test_summary_and_report_have_head_that_verifies_journal(start, tree, tmp_path):
    place = tmp_path / "m.journal"
    run = start("sar-run", tree, "--journal", place, "--report", tmp_path / "r.json")
    assert run.end() == 1
    (head,) = re.findall(
        "Journal hash \\(verify with sar-journal check --head\\): ([0-9a-f]{64})", run.output
    )
    assert json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))["runs"][0]["head"] == head
    assert start("sar-journal", "check", place, "--head", head).end() == 0
    run = start("sar-run", tree, "--journal", place, "--format", "json")
    assert run.end() == 1
    (head,) = re.findall('"head": "([0-9a-f]{64})"', run.output)
    assert start("sar-journal", "check", place, "--head", head).end() == 0
    show = start("sar-journal", "show", place)
    assert show.end() == 0
    assert f"head of the chain: {head}" in show.output


def test_report_of_resumed_mission_covers_all_runs(start, tmp_path):
    place, ros = tmp_path / "m.journal", ("--ros-args", "-p", "zone_order:=[zone_a, zone_b]")
    first = start("sar-run", "--sim", "--speed", "20", "--journal", place, *ros)
    first.wait_for("--- Zone 2/2: zone_b").stop()
    again = ("--journal", place, "--resume", "--report", tmp_path / "r.json")
    assert start("sar-run", "--sim", "--speed", "20", *again, *ros).end() == 0
    data = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert len(data["runs"]) == 2
    assert {zone["name"]: zone["state"] for zone in data["landmarks"]["zones"]} == {
        "zone_a": "visited",
        "zone_b": "visited",
    }
    assert [each["name"] for each in data["landmarks"]["survivors"]] == ["survivor_1"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["--report", "r.pdf"],
            "the report format of r.pdf is unknown (known file name endings: .html, .json, .geojson, .kml, .cot, .cap)",
        ),
        (["--report", "r.cot"], "r.cot contains world coordinates. Add georeference"),
        (["--report", "not/there/r.html"], "not/there does not exist"),
        (["--check", "--report", "r.html"], "--check does not run the mission"),
        (
            ["--report", "r.cap", "--ros-args", "-p", "georeference.lat:=91.0"],
            "parameters:\n  georeference.lon: is missing",
        ),
    ],
)
def test_impossible_report_is_rejected_before_start(start, tree, arguments, words):
    run = start("sar-run", tree, *arguments)
    assert run.end() == 2
    assert words in run.output
