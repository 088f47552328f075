"""Tests of advice about implausible numbers, for every numeric parameter that a mission reads."""

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest

from sar_compiler.missions import ParameterError, ParameterReader
from sar_compiler.missions.json_files import JsonFile
from sar_compiler.missions.parameter_file import read_parameter_file
from sar_compiler.missions.parameter_reader import read_run
from sar_compiler.nodes.numbers import unit_of_key
from search_and_rescue.plugin import MISSION
from tests.documents.test_advice import MEANT, NUMBER, ROUNDED, follows
from tests.missions.test_areas_file import begun, feature

SHIPPED = {
    path.name: path for path in sorted(Path("config").glob("*_params.yaml")) if "nav2" not in path.name
}
GIVEN: dict[str, object] = {
    **read_parameter_file(SHIPPED["search_sweeps_params.yaml"], "/search_and_rescue"),
    "time_limit_sec": 600.0,
    "arrival_tolerance_m": 1.0,
    "duplicate_radius_m": 1.0,
    "energy.per_m": 0.001,
    "energy.reserve": 0.1,
    "georeference.lat": 48.1,
    "georeference.lon": 11.5,
    "georeference.heading": 0.0,
    "charging.dock.x": 0.0,
    "charging.dock.y": 0.0,
    "charging.dock.yaw": 0.0,
    "startup_timeout_sec": 60.0,
}
NUMBERS = sorted(
    key for key, value in GIVEN.items() if type(value) in (int, float) and not key.startswith("survivors")
)
WRITTEN = sorted({text for unit in MEANT.values() for text in unit} | {"soon", "1,500", "7 apples", "1e308"})


def read(parameters: dict[str, object]) -> ParameterReader:
    reader = ParameterReader(parameters)
    read_run(reader)
    MISSION.begin(reader)
    return reader


def as_ros_reads(text: str) -> object:
    """Return the value that ROS reads from text in a parameter file."""
    return float(text) if re.fullmatch(r"-?[\d.]+(e\d+)?", text) else text.strip("'")


def complaints(key: str, value: object) -> list[str]:
    """Return the problems and notes about a parameter."""
    reader = read({**GIVEN, key: value})
    return [str(each) for each in reader.problems if each.key == key] + [
        note for note in reader.notes if note.startswith(key)
    ]


@pytest.mark.parametrize("path", SHIPPED.values(), ids=SHIPPED)
def test_shipped_file_has_no_unusual_number(path: Path) -> None:
    reader = read(dict(read_parameter_file(path, "/search_and_rescue")))
    assert (reader.problems, [note for note in reader.notes if "unusual" in note]) == ([], [])


@pytest.mark.parametrize("key", NUMBERS)
def test_numbers_in_advice_follow_from_written_value(key: str) -> None:
    unit = unit_of_key(key)
    for text in WRITTEN:
        for said in complaints(key, as_ros_reads(text)):
            advised = (
                [float(each) for each in NUMBER.findall(said.rpartition("write ")[2])]
                if "write " in said
                else []
            )
            assert all(follows(each, text, unit, said) for each in advised), said


@pytest.mark.parametrize(
    ("key", "text", "number"),
    [
        pytest.param(key, text, number, id=f"{key}={text}")
        for key in NUMBERS
        for text, number in MEANT.get(unit_of_key(key), {}).items()
    ],
)
def test_value_in_other_notation_or_unit_gets_converted_number(key: str, text: str, number: float) -> None:
    value = as_ros_reads(text)
    said = complaints(key, value)
    if not said:
        assert isinstance(value, float), "a text is no number"
        return
    advised = said[0].rpartition("write ")[2].rstrip(")")
    if "quotes" not in advised and "write" in said[0]:
        assert math.isclose(float(NUMBER.findall(advised)[0]), number, rel_tol=ROUNDED), said


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("initial_pose.yaw", 90.0, "initial_pose.yaw is 90, which is implausible: radians are usually from -6.2832 to 6.2832; 90 degrees are 1.5708 rad: write 1.5708"),
        ("initial_pose.yaw", "30 degrees", "initial_pose.yaw: must be a number, but is the string '30 degrees' (write 0.5236)"),
        ("time_limit_sec", "20s", "time_limit_sec: must be a number, but is the string '20s' (write 20)"),
        ("time_limit_sec", "0,5", "time_limit_sec: must be a number, but is the string '0,5' (write 0.5)"),
        ("time_limit_sec", [30.0], "time_limit_sec: must be a number, but is the list [30.0] (write 30.0, without brackets)"),
        ("time_limit_sec", "soon", "time_limit_sec: must be a number, but is the string 'soon' (write only the number, in seconds)"),
        ("time_limit_sec", 1e308, "time_limit_sec: must be seconds from 0 to 1000000000, but is 1e+308"),
        ("energy.reserve", 15, "energy.reserve: must be a share from 0 to 1, but is 15; 15 percent are 0.15: write 0.15"),
        ("energy.reserve", 10**400, "energy.reserve: must be a finite number, but is inf"),
        ("base_station.x", 10**400, "base_station.x: must be a finite number, but is inf"),
        ("base_station.x", 5e6, "base_station.x: must be metres from -1000000 to 1000000, but is 5000000; 5000000 mm are 5000 m: write 5000"),
    ],
)  # fmt: skip
def test_implausible_number_gets_expected_message(key: str, value: object, said: str) -> None:
    assert complaints(key, value) == [said]


@pytest.mark.parametrize("value", [1e308, 10**400, -1.0, "3m", True, [2.0]])
@pytest.mark.parametrize("key", ["sweep_width", "detection_range", "poa", "pod", "look_sec", "priority"])
def test_invalid_area_property_is_reported_with_location(key: str, value: Any, tmp_path: Path) -> None:
    if key == "priority" and isinstance(value, float):
        assert begun(tmp_path, [feature(priority=value)]).zones.remaining_zones()
        return
    with pytest.raises(ParameterError) as raised:
        begun(tmp_path, [feature(**{key: value})])
    [said] = [each for each in raised.value.problems if each.key.endswith(key)]
    assert said.place.rsplit(":", 2)[0] == str(tmp_path / "areas.geojson")
    assert all(each.place for each in raised.value.problems)


def test_areas_file_errors_have_line_and_column(tmp_path: Path) -> None:
    wrong = [
        feature("", title=""),
        feature("hole", rings=[[[11.5, 48.1], [11.6, 48.1], [11.5, 48.2]], [[1, 2]]]),
        feature("far", rings=[[[11.5, 48.1], [48.1, 11.5], [11.5, 48.2]]]),
        feature("mark", rings=[[[11.5, 48.1], "corner", [11.5, 48.2]]]),
        feature("line", kind="Circle"),
        feature("twice"),
        feature("twice"),
        feature("a.b"),
    ]
    text = json.dumps({"type": "FeatureCollection", "features": wrong}, indent=1)
    with pytest.raises(ParameterError) as raised:
        begun(tmp_path, text)
    marked = []
    for problem in raised.value.problems:
        file, line, column = problem.place.rsplit(":", 2)
        assert file == str(tmp_path / "areas.geojson")
        marked.append(text.splitlines()[int(line) - 1][int(column) - 1 :].rstrip(","))
    assert marked == ['""', "[", "[", '"corner"', '"Circle"', '"twice"', '"a.b"']


def test_duplicate_key_in_areas_file_is_reported_at_second_location(tmp_path: Path) -> None:
    text = json.dumps({"type": "FeatureCollection", "features": [feature(title='{ "name": [')]}, indent=1)
    text = text.replace('"title"', '"n\\u0061me" : "south", "title"')
    assert '"n\\u0061me"' in text
    with pytest.raises(ParameterError) as raised:
        begun(tmp_path, text)
    (problem,) = raised.value.problems
    assert "contains the key 'name' twice" in str(problem)
    line, column = map(int, problem.place.rsplit(":", 2)[1:])
    assert text.splitlines()[line - 1][column - 1 :].startswith('"n\\u0061me" :')


def test_json_location_is_that_of_value_or_last_existing_parent() -> None:
    file = JsonFile(
        '{"a": [1,\n  {"b\\"": "\\u00e9", "c": {}}],\n "a ": 2, "a": [{"c": null, "d": [[], 3]}]}', "f"
    )
    assert file.data["a"] == [{"c": None, "d": [[], 3]}], "of equal keys, the last one counts"
    assert [
        file.location_of(*path)
        for path in [(), ("a",), ("a", 0, "d", 1), ("a", 0, "c", "x"), ("a", 7), ("a ", 0)]
    ] == [
        "f:1:1",
        "f:3:16",
        "f:3:39",
        "f:3:23",
        "f:3:16",
        "f:3:8",
    ]
