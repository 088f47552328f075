"""Tests of the document schemas: shipped files match them, and they have the titles and descriptions for findings and editors."""

import json
import os
from pathlib import Path

import jsonschema
import pytest
import yaml

from sar_compiler.documents.located import UNIT
from sar_compiler.documents.toml_files import read_toml
from sar_compiler.documents.yaml_files import parse_yaml, read_yaml
from sar_compiler.opener import DOCUMENT
from sar_compiler.testing import RENEW
from sar_compiler.tree.kinds import ERRORS, KINDS
from tests.checks.test_json_schema import FRAGMENT, references_in, target_of
from tests.docs.markdown import blocks, codes, tables


def path_of(name):
    return Path(f"schemas/sar_{name}.schema.json")


NAMES = ("scenario", "properties", "world", "map", "settings")
SCHEMAS = {name: json.loads(path_of(name).read_text(encoding="utf-8")) for name in NAMES}
SHIPPED = {
    **dict.fromkeys(sorted(Path("examples/scenarios").glob("*.yaml")), "scenario"),
    **dict.fromkeys(sorted(Path("worlds").glob("*.yaml")), "world"),
    **dict.fromkeys(sorted(Path("maps").glob("*.yaml")), "map"),
    **dict.fromkeys(sorted(Path("config").glob("*_properties.yaml")), "properties"),
}
PAGES = {"scenarios": "scenario", "properties": "properties", "world": "world", "configuration": "settings"}
# The page shows this file as an example with errors.
FILE_WITH_ERRORS = "slips.yaml"
MODELINE = {"yaml": "# yaml-language-server: $schema=", "toml": "#:schema "}
# The keywords that findings can describe.
SUPPORTED_KEYWORDS = {
    *("$schema", "$ref", "definitions", "title", "description", "examples"),
    *("type", "enum", "const", "minimum", "maximum", "exclusiveMinimum", "pattern", "minLength"),
    *("properties", "additionalProperties", "required", "items", "minItems", "maxItems"),
    *("if", "then", "else", "anyOf", "propertyNames", "not", UNIT),
}


def parts(schema):
    """Yield a schema and all schemas in it that findings can come from."""
    if not isinstance(schema, dict):
        return
    yield schema
    for keyword in ("properties", "definitions"):
        for inner in schema.get(keyword, {}).values():
            yield from parts(inner)
    items = schema.get("items")
    for inner in items if isinstance(items, list) else [items]:
        yield from parts(inner)
    for keyword in ("additionalProperties", "then", "else"):
        yield from parts(schema.get(keyword))


@pytest.mark.parametrize("name", NAMES)
def test_every_reference_leads_to_a_definition(name):
    references = set(references_in(SCHEMAS[name]))
    assert [each for each in references if not FRAGMENT.fullmatch(each)] == []
    assert [each for each in references if not isinstance(target_of(each, SCHEMAS[name]), dict)] == []


def types_of(schema):
    types = schema.get("type", [])
    return {types} if isinstance(types, str) else set(types)


@pytest.mark.parametrize("name", NAMES)
def test_schema_is_valid_draft_7(name):
    assert SCHEMAS[name]["$schema"] == "http://json-schema.org/draft-07/schema#"
    jsonschema.Draft7Validator.check_schema(SCHEMAS[name])


@pytest.mark.parametrize("name", NAMES)
def test_schema_uses_only_supported_keywords(name):
    assert {keyword for part in parts(SCHEMAS[name]) for keyword in part} - SUPPORTED_KEYWORDS == set()


@pytest.mark.parametrize("name", NAMES)
def test_every_value_except_mappings_and_enums_has_a_title(name):
    scalars = [part for part in parts(SCHEMAS[name]) if types_of(part) - {"object"} and "enum" not in part]
    assert [part for part in scalars if "title" not in part] == []


@pytest.mark.parametrize("name", NAMES)
def test_every_top_level_key_has_a_description(name):
    top = SCHEMAS[name]["properties"]
    assert [key for key, part in top.items() if not part.get("description", "").endswith(".")] == []


def test_shared_definitions_of_two_schemas_are_equal():
    scenario, properties = SCHEMAS["scenario"], SCHEMAS["properties"]
    shared = scenario["definitions"].keys() & properties["definitions"].keys()
    common = {
        "probability",
        "event",
        "events",
        "fact",
        "possible_outcome",
        "possible_outcomes",
        "status",
        "time",
    }
    assert shared == common
    assert all(scenario["definitions"][each] == properties["definitions"][each] for each in shared)
    for key in ("facts", "outcomes", "parameters"):
        assert scenario["properties"][key] == properties["properties"][key]


def test_finding_kinds_in_settings_schema_are_as_reviewed():
    schema, kinds = json.loads(path_of("settings").read_text(encoding="utf-8")), list(KINDS)
    wanted = {each: {"$ref": f"#/definitions/{'firm' if each in ERRORS else 'severity'}"} for each in kinds}
    if os.environ.get(RENEW):
        schema["properties"]["findings"]["properties"] = wanted
        path_of("settings").write_text(json.dumps(schema, indent=2) + "\n", encoding="utf-8")
    assert schema["properties"]["findings"]["properties"] == wanted, "renew it: make schemas"


@pytest.mark.parametrize("path", SHIPPED, ids=str)
def test_shipped_file_matches_its_schema(path):
    document = read_yaml(path, DOCUMENT, "")
    document.validate(SHIPPED[path])
    assert document.findings == []


@pytest.mark.parametrize("path", SHIPPED, ids=str)
def test_other_yaml_parser_accepts_shipped_file(path):
    jsonschema.Draft7Validator(SCHEMAS[SHIPPED[path]]).validate(yaml.safe_load(path.read_text("utf-8")))


@pytest.mark.parametrize("path", [path for path, name in SHIPPED.items() if name != "map"], ids=str)
def test_shipped_file_names_its_schema_for_editors(path):
    first = path.read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith(MODELINE["yaml"])
    assert (path.parent / first.removeprefix(MODELINE["yaml"])).resolve() == path_of(SHIPPED[path]).resolve()


@pytest.mark.parametrize("page", PAGES)
def test_files_on_page_match_their_schema(page, tmp_path):
    held = 0
    for block in blocks(Path(f"docs/reference/{page}.md")):
        if block.language == "toml":
            (tmp_path / "sar.toml").write_text(block.text, encoding="utf-8")
            document = read_toml(tmp_path / "sar.toml", "sar.toml")
        elif (
            block.language == "yaml"
            and block.file != FILE_WITH_ERRORS
            and "repos:" not in block.text
            and "steps:" not in block.text
        ):
            document = parse_yaml(block.text, block.file, "")
        else:
            continue
        document.validate(PAGES[page])
        assert document.findings == []
        held += 1
    assert held > 0


def test_every_world_key_is_in_the_table_of_its_page():
    rows = [
        cells for heading, _, cells in tables(Path("docs/reference/world.md")) if heading == "World files"
    ]
    keys = [codes(cells[0])[0] for cells in rows]
    assert keys == list(SCHEMAS["world"]["properties"])
    assert [key for key, cells in zip(keys, rows, strict=True) if cells[2].startswith("yes")] == SCHEMAS[
        "world"
    ]["required"]


@pytest.mark.parametrize("page", PAGES)
def test_page_shows_how_a_file_names_its_schema(page):
    language = "toml" if page == "configuration" else "yaml"
    text = Path(f"docs/reference/{page}.md").read_text(encoding="utf-8")
    assert f"{MODELINE[language]}../schemas/sar_{PAGES[page]}.schema.json" in text
