"""Tests of the how-to page about covering areas: its commands print the shown output, and its tables are complete."""

import shutil
from pathlib import Path

import pytest

from sar_compiler.cli.compile import main
from search_and_rescue import SPECS
from search_and_rescue.search_theory import SWEEP_FACTORS
from tests.docs.markdown import blocks, codes, tables
from tests.docs.test_worked_pages import follow

PAGE = Path("docs/how-to/cover-areas.md").resolve()


@pytest.mark.costly
@pytest.mark.ros
def test_commands_on_coverage_page_print_shown_output(tmp_path: Path) -> None:
    (tmp_path / "config").symlink_to(Path("config").resolve())
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 1
    assert otherwise == [], "\n".join(otherwise)


def test_page_lists_every_pattern() -> None:
    (spec,) = [spec for spec in SPECS if spec.tag == "PlanSweep"]
    told = [codes(cells[0])[0] for heading, _, cells in tables(PAGE) if heading == "The run"]
    assert set(told) == set(spec.parameters["pattern"].value_type.choices)


def test_page_lists_sweep_width_factors() -> None:
    told = {codes(cells[0])[0]: cells[1] for heading, _, cells in tables(PAGE) if heading == "The outline"}
    assert told == {
        name: f"{factor} \N{MULTIPLICATION SIGN} detection range" for name, factor in SWEEP_FACTORS.items()
    }


def test_tree_lines_match_shipped_tree() -> None:
    shown, *_ = [block.text for block in blocks(PAGE) if block.language == "xml"]
    assert shown.strip() in Path("trees/search_sweeps.xml").read_text(encoding="utf-8")


def listening_tree(folder: Path, number: int = 1) -> Path:
    """Write the shipped tree with an XML block of the page in place of the start of its `Piece`; return the file."""
    shown = [block.text for block in blocks(PAGE) if block.language == "xml"][number]
    shipped = Path("trees/search_sweeps.xml").read_text(encoding="utf-8")
    before, found, behind = shipped.partition('<Sequence name="Piece">')
    end = "</RetryUntilSuccessful>"
    behind = behind.partition(end)[2].partition(end)[2]
    assert found
    place = Path(shutil.copytree("trees", folder / "trees"), "listening.xml")
    place.write_text(before + shown + behind, encoding="utf-8")
    return place


@pytest.mark.costly
def test_tree_that_detects_while_driving_keeps_shipped_properties(tmp_path: Path) -> None:
    assert main(["verify", str(listening_tree(tmp_path)), "--set", "zones_left=1"]) == 0


def passing_tree(folder: Path) -> Path:
    """Write the shipped tree with the page's block that drives through the pieces; return the file."""
    return listening_tree(folder, 2)


@pytest.mark.costly
def test_tree_that_drives_through_pieces_keeps_shipped_properties(tmp_path: Path) -> None:
    shipped = Path("config/search_sweeps_properties.yaml").read_text(encoding="utf-8")
    legs = tmp_path / "properties.yaml"
    legs.write_text(
        shipped.replace("[NavigateToPiece starts,", "[NavigateToPiece starts, NavigateThroughPieces starts,"),
        encoding="utf-8",
    )
    command = ["verify", str(passing_tree(tmp_path)), "--set", "zones_left=1", "--properties", str(legs)]
    assert main(command) == 0


def test_outline_on_page_matches_shipped_parameters() -> None:
    (shown,) = [block.text for block in blocks(PAGE) if block.language == "yaml"]
    shipped = Path("config/search_sweeps_params.yaml").read_text(encoding="utf-8")
    assert " ".join(shown.split()) in " ".join(shipped.split())
