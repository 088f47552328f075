"""The page about where to look first does what it says."""

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
def test_the_page_shows_the_plan_that_is_told_and_what_is_proved(tmp_path: Path) -> None:
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 2
    assert otherwise == [], "\n".join(otherwise)


def test_the_page_has_the_zones_of_the_shipped_parameters() -> None:
    (written,) = [block.text for block in blocks(PAGE) if block.file == "areas.yaml"]
    said, shipped = (
        yaml.safe_load(text)["/**"]["ros__parameters"]
        for text in (written, PARAMS.read_text(encoding="utf-8"))
    )
    assert {key: shipped[key] for key in said} == said


def test_the_page_names_every_order_and_how_far_it_is_exact() -> None:
    (spec,) = [spec for spec in SPECS if spec.tag == "ChooseZone"]
    order = spec.parameters["order"]
    told = [
        codes(cells[0])[0] for heading, _, cells in tables(PAGE) if heading == "Use `ChooseZone` in a tree"
    ]
    assert set(told) == set(order.value_type.choices)
    assert f"Up to {EXACT_UP_TO} zones" in PAGE.read_text(encoding="utf-8")


def test_the_lines_of_the_tree_are_those_of_the_shipped_one() -> None:
    shown = [line for block in blocks(PAGE) if block.language == "xml" for line in block.text.splitlines()]
    tree = Path("trees/search_areas.xml").read_text(encoding="utf-8")
    assert len(shown) > 5
    assert [line for line in shown if line.strip() not in tree] == []
