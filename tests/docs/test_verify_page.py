"""Tests of the properties page: its commands print the shown output, and its tables are complete."""

import json
import re
from pathlib import Path

from sar_compiler.analysis.verify import verdicts
from tests.docs.markdown import codes, tables
from tests.docs.test_worked_pages import follow

PAGE = Path("docs/reference/properties.md").resolve()
SCHEMA = json.loads(Path("schemas/sar_properties.schema.json").read_text(encoding="utf-8"))


def cells(heading, column=0):
    return [row[column] for title, _, row in tables(PAGE) if title == heading]


def test_commands_on_properties_page_print_shown_output(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 3
    assert otherwise == [], "\n".join(otherwise)


def test_every_built_in_property_is_in_the_table():
    asked = [verdicts.NO_ERROR, verdicts.EVERY_LEAF, verdicts.AN_END, verdicts.NO_LIVELOCK]
    assert cells("Properties of every tree") == asked


def test_every_key_of_a_property_is_in_the_table():
    shown = {code.split(":")[0] for cell in cells("Forms") for code in codes(cell)}
    assert shown == set(SCHEMA["definitions"]["property"]["properties"])


def test_every_finding_code_of_verify_is_explained():
    text = "".join(
        path.read_text(encoding="utf-8") for path in Path("sar_compiler/analysis/verify").glob("*.py")
    )
    written = set(re.findall(r'"([a-z]+(?:-[a-z]+)+)"', text)) - {"script-error"}
    explained = {code for cell in cells("The command") for code in codes(cell)}
    assert written <= explained
