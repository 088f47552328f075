"""Tests of advice about documents: its numbers follow from the written numbers, and examples are marked as examples.

The cases come from the schemas: each property gets a percentage, other units, a decimal comma, a string and a list.
"""

import json
import math
import re
from contextlib import suppress
from pathlib import Path

import pytest

from sar_compiler.cli.compile import main as compile_command
from sar_compiler.cli.sim import main as sim_command
from sar_compiler.documents.located import UNIT
from sar_compiler.documents.toml_files import read_toml
from sar_compiler.documents.yaml_files import parse_yaml
from sar_compiler.nodes.numbers import UNITS, find_implausible_number
from sar_compiler.tree.diagnostic import TreeError
from tests.checks.test_json_schema import target_of
from tests.documents.test_schemas import NAMES, SCHEMAS, parts, types_of
from tests.trees import document

# The value of each text in the unit of the property. A text that is not listed for a unit has no value in it.
MEANT = {
    "share": {"80": 0.8, "80%": 0.8, "80 percent": 0.8, "0,5": 0.5, "'80'": 0.8, "'80 %'": 0.8, "30": 0.3, "'5'": 0.05},
    "s": {"20s": 20, "500ms": 0.5, "2 min": 120, "1,5": 1.5, "1,5 sec": 1.5, "'20s'": 20, "1e6": 1000},
    "rad": {"30 degrees": 0.5236, "90deg": 1.5708, "90.0": 1.5708, "-45": -0.7854, "0,5": 0.5, "'90 deg'": 1.5708},
    "m": {"250 cm": 2.5, "2km": 2000, "0,5": 0.5, "'3m'": 3, "500000": 500},
    "": {"1_000": 1000, "0,5": 0.5},
}  # fmt: skip
MEANINGLESS = ["soon", "[soon]", "[1, 2, 3]", "{a: 1}", "7 apples", "-3", "1,500", "1e300"]
WRITTEN = sorted({text for texts in MEANT.values() for text in texts} | {*MEANINGLESS, "'5'", "[80]", "[5]"})
ROUNDED = 1e-4
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def properties(schema, root, path=()):
    """Yield the path and the schema of each possible value of a file; one example for free names."""
    if "$ref" in schema:
        schema = target_of(schema["$ref"], root)
    yield path, schema
    for name, inner in schema.get("properties", {}).items():
        yield from properties(inner, root, (*path, name)) if isinstance(inner, dict) else ()
    if isinstance(schema.get("additionalProperties"), dict):
        yield from properties(schema["additionalProperties"], root, (*path, "free"))
    for form in ("then", "else"):
        if isinstance(schema.get(form), dict) and len(path) < 6:
            yield from (each for each in properties(schema[form], root, path) if each[0] != path)


PLACES = sorted(
    {
        (name, path): bool(types_of(schema) & {"number", "integer"}) and "boolean" not in types_of(schema)
        for name in NAMES
        for path, schema in properties(SCHEMAS[name], SCHEMAS[name])
        # All kinds of findings have the same schema, so one is enough.
        if path and (path[0] != "findings" or path[1:] in {(), ("unused-tree",)})
    }.items()
)
NUMERIC = [place for place, is_number in PLACES if is_number]


def unit_at(name, path):
    return next(
        (
            each.get(UNIT, "")
            for at, each in properties(SCHEMAS[name], SCHEMAS[name])
            if at == path and types_of(each) & {"number", "integer"}
        ),
        "",
    )


def findings_about(name, path, text, folder):
    """Return the findings about the last key of a path in a file with only this path."""
    if name == "settings":
        value = (
            text if re.fullmatch(r"\[?-?[\d., ]*\d\]?|'.*'", text) and "," not in text else json.dumps(text)
        )
        (folder / "sar.toml").write_text(f"{'.'.join(path)} = {value}\n", encoding="utf-8")
        document = read_toml(folder / "sar.toml", "sar.toml")
    else:
        lines = [f"{'  ' * depth}{key}:" for depth, key in enumerate(path)]
        document = parse_yaml("\n".join([*lines[:-1], f"{lines[-1]} {text}"]), "file.yaml", "")
    with suppress(TreeError):
        document.validate(name)
    last, first = len(path), len(path[-1])
    return [
        each
        for each in document.findings
        if name == "settings" or (each.span.line == last and each.span.column > first)
    ]


def numbers_in_advice(finding):
    """Return the numbers that the advice tells the user to write, without those of examples."""
    if finding.suggestion is not None:
        return [float(each) for each in NUMBER.findall(finding.suggestion.replace("_", ""))]
    hint = (finding.hint or "").partition("for example")[0].replace("_", "")
    return [float(each) for each in NUMBER.findall(hint.rpartition("write ")[2])] if "write " in hint else []


# The other unit in which a number was probably written, and its factor to the unit of the property.
MISTAKEN = {
    "share": ("percent", 0.01),
    "rad": ("degrees", math.pi / 180),
    "s": ("ms", 0.001),
    "m": ("mm", 0.001),
    "m/s": ("mm/s", 0.001),
}


def follows(number, text, unit, advice):
    """Return whether a number is a written number, its value in the unit, or a limit of the unit."""
    forms = {text.replace("_", ""), text.replace(",", "."), text.replace(",", "")}
    read = [float(each) for form in forms for each in NUMBER.findall(form)]
    limits = UNITS[unit].usual[:2] if unit in UNITS else ()
    meant = [MEANT[unit][text]] if text in MEANT.get(unit, {}) else []
    word, times = MISTAKEN.get(unit, ("nothing", 1.0))
    converted = [each * times for each in read] if word in advice else []
    known = [*read, *limits, *meant, *converted]
    return any(abs(number - each) <= ROUNDED * abs(each) for each in known)


@pytest.mark.parametrize("name", NAMES)
def test_numbers_in_advice_follow_from_written_numbers(name, tmp_path):
    wrong = [
        (path, text, number, finding.render())
        for (schema, path), _ in PLACES
        if schema == name
        for text in WRITTEN
        for finding in findings_about(name, path, text, tmp_path)
        for number in numbers_in_advice(finding)
        if not follows(number, text, unit_at(name, path), finding.advice)
    ]
    assert wrong == []


@pytest.mark.parametrize(
    ("name", "path", "text", "number"),
    [
        pytest.param(*place, text, number, id=f"{'.'.join(place[1])}={text}")
        for place in NUMERIC
        for text, number in MEANT.get(unit_at(*place), {}).items()
        if unit_at(*place)
    ],
)
def test_number_in_other_notation_or_unit_gets_correct_suggestion(name, path, text, number, tmp_path):
    about = findings_about(name, path, text, tmp_path)
    schema = next(each for at, each in properties(SCHEMAS[name], SCHEMAS[name]) if at == path)
    if not about:
        # The property accepts a duration with a unit, or the number is plausible.
        assert "pattern" in schema or find_implausible_number(float(text), unit_at(name, path)) is None
        return
    [finding] = about
    lowest, highest = schema.get("minimum", -1e9), schema.get("maximum", 1e9)
    if "pattern" in schema:
        # A suggestion may keep the unit.
        assert finding.suggestion or finding.hint
    elif lowest <= number <= highest and not (number <= 0 and "exclusiveMinimum" in schema):
        assert numbers_in_advice(finding) == [pytest.approx(number, rel=1e-4)], finding.render()
        for each in findings_about(name, path, finding.suggestion or f"{number}", tmp_path):
            pytest.fail(each.render())


@pytest.mark.parametrize(
    ("text", "advice"),
    [
        ("leaves: {A: {outcome: SUCCESS, probability: 30}}", "30 percent are 0.3: write 0.3"),
        ("leaves: {A: {outcome: SUCCESS, probability: lots}}", "for example 0.1"),
        ("outcomes: {A: {outcome: SUCCESS, p: 80}}", "80 percent are 0.8: write 0.8"),
        ("outcomes: {A: {outcome: SUCCESS, p: '80'}}", "80 percent are 0.8: write 0.8, without quotes"),
        ("outcomes: {A: {outcome: SUCCESS, p: 80%}}", "did you mean '0.8'?"),
        ("outcomes: {A: {outcome: SUCCESS, p: '0,5'}}", "write 0.5, without quotes"),
        ("outcomes: {A: {outcome: SUCCESS, p: [80, 90]}}", "80 percent are 0.8: write 0.8"),
        ("outcomes: {A: {outcome: SUCCESS, p: [0.5]}}", "write 0.5, without brackets"),
        ("outcomes: {A: {outcome: SUCCESS, sec: 20s}}", "did you mean '20'?"),
        ("outcomes: {A: {outcome: SUCCESS, sec: 150}}", None),
        ("outcomes: {A: {outcome: SUCCESS, p: 150}}", "for example 0.9"),
        ("outcomes: {A: {outcome: SUCCESS, sec: '1,500'}}", "the comma is ambiguous: write 1500, or 1.5"),
        ("period: 2 sec", "did you mean '2s'?"),
        ("period: 1,5s", "did you mean '1.5s'?"),
        ("period: soon", "for example 4s, 500ms or 2min"),
        ("leaves: {A: {after: 1s}}", "for example outcome: SUCCESS"),
    ],
)
def test_advice_marks_examples_and_converts_written_numbers(text, advice):
    read = parse_yaml(text, "file.yaml", "")
    read.validate("scenario")
    assert [each.advice for each in read.findings][:1] == ([] if advice is None else [advice])


def test_string_instead_of_list_gets_advice_with_brackets(tmp_path):
    (tmp_path / "sar.toml").write_text('models = "nav2:jazzy"\n', encoding="utf-8")
    document = read_toml(tmp_path / "sar.toml", "sar.toml")
    document.validate("settings")
    assert [each.hint for each in document.findings] == ['write ["nav2:jazzy"]']


def test_implausible_number_is_a_warning_and_file_is_usable():
    document = parse_yaml("robot: {x: 1, y: 1, yaw: 90.0, radius: 0.2}\nwalls: []", "world.yaml", "")
    assert document.validate("world").data["robot"]["yaw"] == 90.0
    document.raise_findings()
    [finding] = document.warnings
    assert (finding.code, finding.span.line, finding.span.column) == ("out-of-range", 1, 26)
    assert finding.hint == "90 degrees are 1.5708 rad: write 1.5708"


@pytest.mark.parametrize("name", NAMES)
def test_every_number_with_unit_has_possible_limits(name):
    for part in (each for each in parts(SCHEMAS[name]) if UNIT in each):
        possible = UNITS[part[UNIT]].possible
        assert part.get("minimum", part.get("exclusiveMinimum")) in possible
        assert part["maximum"] in possible


# The numbers without a unit.
WITHOUT_UNIT = {
    "ticks": "a count",
    "count": "a count",
    "times": "a count",
    "every": "a count",
    "within": "a duration, or a number of ticks",
    "free": "whatever a fact or a count is",
}


def test_every_schema_number_has_a_unit_or_is_listed_without_one():
    assert {path[-1] for name, path in NUMERIC if not unit_at(name, path)} == WITHOUT_UNIT.keys() - {"count"}


@pytest.mark.parametrize("path", sorted(Path("schemas").glob("*.schema.json")), ids=str)
def test_every_unit_in_a_schema_is_in_the_table(path):
    def units(value):
        if isinstance(value, dict):
            yield from (each for key, each in value.items() if key == UNIT)
            for inner in value.values():
                yield from units(inner)
        for inner in value if isinstance(value, list) else []:
            yield from units(inner)

    assert set(units(json.loads(path.read_text(encoding="utf-8")))) <= UNITS.keys()


@pytest.mark.parametrize(
    "words",
    [
        ["simulate", "tree.xml", "--scenario"],
        ["verify", "tree.xml", "--properties"],
        ["sweep", "tree.xml", "--runs", "1", "--unusual", "0.1", "--scenario"],
    ],
    ids=lambda words: words[0],
)
def test_command_prints_file_warnings_and_continues(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("tree.xml").write_text(document("<NavigateToBase/>"), encoding="utf-8")
    text = "outcomes: {NavigateToBase: [RUNNING, {status: SUCCESS, sec: 5000000}]}"
    Path("file.yaml").write_text(text, encoding="utf-8")
    assert compile_command([*words, "file.yaml"]) in (0, 1)
    out, err = capsys.readouterr()
    assert out
    assert "error" not in err
    place = f"1:{text.index('5000000') + 1}"
    assert (
        f"file.yaml:{place}: warning[out-of-range]: 'sec' is 5000000, which is implausible: seconds are usually"
        in err
    )


def test_simulator_prints_warnings_about_world(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = "robot: {x: 1, y: 1, yaw: 90.0, radius: 0.2}\nwalls: []\nsurvey: [{x: 1, y: 1}, {x: 1.5, y: 1}]\n"
    Path("flat.yaml").write_text(text, encoding="utf-8")
    assert sim_command(["map", "flat.yaml", "--output", "map"]) == 0
    assert "flat.yaml:1:26: warning[out-of-range]: 'yaw' is 90" in capsys.readouterr().err
