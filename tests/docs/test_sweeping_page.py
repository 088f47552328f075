"""The page about sweeps does what it says, and names every pattern and every factor."""

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
def test_the_flight_that_the_page_shows_is_what_is_told(tmp_path: Path) -> None:
    (tmp_path / "config").symlink_to(Path("config").resolve())
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 1
    assert otherwise == [], "\n".join(otherwise)


def test_the_page_names_every_pattern() -> None:
    (spec,) = [spec for spec in SPECS if spec.tag == "PlanSweep"]
    told = [codes(cells[0])[0] for heading, _, cells in tables(PAGE) if heading == "The run"]
    assert set(told) == set(spec.parameters["pattern"].value_type.choices)


def test_the_page_has_the_factors_of_the_sweep_width() -> None:
    told = {codes(cells[0])[0]: cells[1] for heading, _, cells in tables(PAGE) if heading == "The outline"}
    assert told == {
        name: f"{factor} \N{MULTIPLICATION SIGN} detection range" for name, factor in SWEEP_FACTORS.items()
    }


def test_the_lines_of_the_tree_are_those_of_the_shipped_one() -> None:
    shown, *_ = [block.text for block in blocks(PAGE) if block.language == "xml"]
    assert shown.strip() in Path("trees/search_sweeps.xml").read_text(encoding="utf-8")


def listening_tree(folder: Path, number: int = 1) -> Path:
    """Write the shipped tree with one of the page's beginnings of a piece in place of its own; return the file."""
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
def test_the_tree_that_listens_on_the_way_keeps_what_the_shipped_one_keeps(tmp_path: Path) -> None:
    assert main(["verify", str(listening_tree(tmp_path)), "--set", "zones_left=1"]) == 0


def passing_tree(folder: Path) -> Path:
    """Write the same with the page's way through the pieces."""
    return listening_tree(folder, 2)


@pytest.mark.costly
def test_the_tree_that_drives_through_pieces_keeps_what_the_shipped_one_keeps(tmp_path: Path) -> None:
    shipped = Path("config/search_sweeps_properties.yaml").read_text(encoding="utf-8")
    legs = tmp_path / "properties.yaml"
    legs.write_text(
        shipped.replace("[NavigateToPiece starts,", "[NavigateToPiece starts, NavigateThroughPieces starts,"),
        encoding="utf-8",
    )
    command = ["verify", str(passing_tree(tmp_path)), "--set", "zones_left=1", "--properties", str(legs)]
    assert main(command) == 0


def test_the_outline_that_the_page_shows_is_that_of_the_shipped_parameters() -> None:
    (shown,) = [block.text for block in blocks(PAGE) if block.language == "yaml"]
    shipped = Path("config/search_sweeps_params.yaml").read_text(encoding="utf-8")
    assert " ".join(shown.split()) in " ".join(shipped.split())
