"""Tests of the how-to page about searching by probability."""

from pathlib import Path

import pytest
import yaml

from search_and_rescue import SPECS
from search_and_rescue.zone_order import EXACT_UP_TO
from tests.docs.markdown import blocks, codes, tables
from tests.docs.test_worked_pages import follow

PAGE = Path("docs/how-to/search-by-probability.md").resolve()
PARAMS = Path("config/search_areas_params.yaml").resolve()


@pytest.mark.ros
def test_commands_on_search_page_print_shown_output(tmp_path: Path) -> None:
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 2
    assert otherwise == [], "\n".join(otherwise)


def test_zones_on_page_match_shipped_parameters() -> None:
    (written,) = [block.text for block in blocks(PAGE) if block.file == "areas.yaml"]
    said, shipped = (
        yaml.safe_load(text)["/**"]["ros__parameters"]
        for text in (written, PARAMS.read_text(encoding="utf-8"))
    )
    assert {key: shipped[key] for key in said} == said


def test_page_lists_every_order_and_the_limit_of_exact_search() -> None:
    (spec,) = [spec for spec in SPECS if spec.tag == "ChooseZone"]
    order = spec.parameters["order"]
    told = [
        codes(cells[0])[0] for heading, _, cells in tables(PAGE) if heading == "Use `ChooseZone` in a tree"
    ]
    assert set(told) == set(order.value_type.choices)
    assert f"Up to {EXACT_UP_TO} zones" in PAGE.read_text(encoding="utf-8")


def test_tree_lines_match_shipped_tree() -> None:
    shown = [line for block in blocks(PAGE) if block.language == "xml" for line in block.text.splitlines()]
    tree = Path("trees/search_areas.xml").read_text(encoding="utf-8")
    assert len(shown) > 5
    assert [line for line in shown if line.strip() not in tree] == []
