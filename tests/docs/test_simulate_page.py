"""Tests of the scenarios page: its commands print the shown output, and its tables are complete."""

import json
from pathlib import Path

from sar_compiler.nodes.registry import load_registry
from sar_compiler.testing import simulate
from tests.docs.markdown import blocks, codes, tables
from tests.docs.test_worked_pages import LEAVES, follow
from tests.trees import document

PAGE = Path("docs/reference/scenarios.md").resolve()
SCHEMA = json.loads(Path("schemas/sar_scenario.schema.json").read_text(encoding="utf-8"))


def test_commands_on_scenarios_page_print_shown_output(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 3
    assert otherwise == []


def first_codes(heading):
    return [codes(cells[0])[0] for title, _, cells in tables(PAGE) if title == heading and codes(cells[0])]


def test_every_key_of_a_scenario_is_in_the_table():
    assert first_codes("The scenario") == list(SCHEMA["properties"])


def test_every_expectation_is_in_the_table():
    assert {code.split(":")[0] for code in first_codes("Expectations")} == set(
        SCHEMA["properties"]["expect"]["properties"]
    )


def test_every_key_of_a_step_is_shown():
    shown = " ".join(first_codes("Outcomes of leaves"))
    assert [key for key in SCHEMA["definitions"]["step"]["properties"] if f"{key}:" not in shown] == []


GRAB = '''
class GrabSample(Behaviour):
    """Grab a sample."""

    def __init__(self, name: str) -> None:
        super().__init__(name)

    def update(self) -> Status:
        return Status.SUCCESS
'''


def test_leaf_with_declared_outcomes_can_be_simulated(tmp_path, monkeypatch):
    (block,) = [each.text for each in blocks(LEAVES) if "GrabSample" in each.text]
    imports = "from py_trees.behaviour import Behaviour\nfrom py_trees.common import Status\n"
    (tmp_path / "page_of_leaves.py").write_text(f"{imports}{block.rstrip()}{GRAB}", encoding="utf-8")
    (tmp_path / "grab.xml").write_text(document("<GrabSample/>"), encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    run = simulate(tmp_path / "grab.xml", registry=load_registry(["page_of_leaves"])).tick(3)
    run.expect(order=["GrabSample grabbed", "GrabSample grabbed", "GrabSample nothing there"])
    assert run.facts == {"samples_left": 0, "held_by_GrabSample": True}
