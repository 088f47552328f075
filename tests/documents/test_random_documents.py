"""Tests that random documents are read, or that every finding has a location in the file."""

import json
import sys
from pathlib import Path

import jsonschema
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.analysis.verify.properties import parse_property_file
from sar_compiler.documents.toml_files import read_toml
from sar_compiler.documents.yaml_files import parse_yaml
from sar_compiler.sim.world import load_world
from sar_compiler.tree.diagnostic import TreeError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SHIPPED = {
    "scenario": Path("examples/scenarios/zone_out_of_reach.yaml"),
    "properties": Path("config/mission_properties.yaml"),
    "world": Path("worlds/disaster_zone.yaml"),
    "map": Path("maps/disaster_zone.yaml"),
}
SETTINGS = 'nodes = ["a.b"] # c\nmodels = []\n[findings]\nsame-name = "off"\n"unread-key" = \'error\'\n'
PIECES = [
    *"{}[]:,-'\"#&*!|>%@`?=. \n",
    *("true", "no", "12:30", "1e400", ".nan", "-1", "2.0", "~", "4s", "0 ticks", "'''", '"""', "[[", "\\u"),
]


def keys_of(schema):
    """Yield the keys that a schema names at any level."""
    if isinstance(schema, dict):
        yield from schema.get("properties", {})
        for inner in schema.values():
            yield from keys_of(inner)


def schema_of(name):
    return json.loads(Path(f"schemas/sar_{name}.schema.json").read_text(encoding="utf-8"))


@st.composite
def changed_text(draw: st.DrawFn, text: str) -> str:
    """Return a text with a few stretches replaced."""
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 12)))
        text = text[:start] + "".join(draw(st.lists(st.sampled_from(PIECES), max_size=3))) + text[end:]
    return text


def plain(name):
    """Return random data with the keys of a schema, so that much of it is almost valid."""
    keys = sorted(set(keys_of(schema_of(name))))
    scalars = st.one_of(
        *(st.integers(-2, 3), st.floats(allow_nan=False), st.booleans(), st.text(max_size=3)),
        st.sampled_from(
            ["4s", "20 ticks", "at most 2", "always", "SUCCESS", "box", "cylinder", "A starts", ""]
        ),
    )
    return st.dictionaries(
        st.sampled_from(keys),
        st.recursive(
            scalars,
            lambda inner: st.one_of(
                st.lists(inner, max_size=3), st.dictionaries(st.sampled_from(keys), inner, max_size=4)
            ),
        ),
    )


def check_locations(findings, text):
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    assert findings
    for finding in findings:
        span = finding.span
        assert finding.render()
        assert 1 <= span.line <= len(lines)
        assert 1 <= span.column <= len(lines[span.line - 1]) + 2


def check_against_schema(name, text):
    """Validate a text against a schema; the remaining values must match it."""
    try:
        document = parse_yaml(text, f"{name}.yaml", "write something")
        left = document.validate(name)
    except TreeError as error:
        check_locations(error.findings, text)
        return
    jsonschema.Draft7Validator(schema_of(name)).validate(left.data)
    if document.findings:
        check_locations(document.findings, text)
    else:
        assert left is document.root


@pytest.mark.parametrize("name", SHIPPED)
@given(data=st.data())
def test_changed_file_matches_schema_or_has_located_findings(name, data):
    check_against_schema(name, data.draw(changed_text(SHIPPED[name].read_text(encoding="utf-8"))))


@pytest.mark.parametrize("name", SHIPPED)
@given(data=st.data())
def test_random_data_matches_schema_or_has_located_findings(name, data):
    check_against_schema(name, yaml.safe_dump(data.draw(plain(name)), allow_unicode=True))


@given(text=changed_text(SHIPPED["properties"].read_text(encoding="utf-8")))
def test_changed_property_file_is_read_or_has_located_findings(text):
    try:
        parse_property_file(text).document.raise_findings()
    except TreeError as error:
        check_locations(error.findings, text)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("random")


@given(data=st.data())
def test_random_world_is_read_or_has_located_findings(folder, data):
    shipped = SHIPPED["world"].read_text(encoding="utf-8")
    text = data.draw(st.one_of(changed_text(shipped), plain("world").map(yaml.safe_dump)))
    path = folder / "world.yaml"
    path.write_bytes(text.encode())
    try:
        load_world(path)
    except TreeError as error:
        check_locations(error.findings, text)


def keys_in(value):
    """Yield the keys in a value at any level, except those in lists of tables."""
    for key, inner in value.entries or ():
        yield key
        yield from keys_in(inner)


@given(text=changed_text(f"{SETTINGS}[a.b]\nc = {{d = 1, e = '}}'}}\nf.g = [1, [2, ']'], {{h = 3}}]\n"))
def test_every_toml_key_has_location_of_its_name(folder, text):
    path = folder / "keys.toml"
    path.write_bytes(text.encode())
    try:
        document = read_toml(path, "keys.toml")
    except TreeError:
        return
    for key in keys_in(document.root):
        written = document.source.text[key.start : key.end]
        assert (next(iter(tomllib.loads(f"{written} = 0"))) if written[0] in "'\"" else written) == key.text


@given(text=changed_text(SETTINGS))
def test_changed_settings_match_schema_or_have_located_findings(folder, text):
    path = folder / "sar.toml"
    path.write_bytes(text.encode())
    try:
        document = read_toml(path, "sar.toml")
        document.validate("settings")
        document.raise_findings()
    except TreeError as error:
        check_locations(error.findings, text)
