"""Tests that every shipped tree compiles to its reviewed golden files. `make golden` renews them."""

from pathlib import Path

import pytest

from sar_compiler.testing import RENEW, assert_matches_golden

GOLDEN = Path("tests/golden")
SHIPPED = sorted(Path("trees").glob("*.xml"))


@pytest.mark.parametrize("tree", SHIPPED, ids=lambda path: path.stem)
@pytest.mark.parametrize("suffix", [".json", ".txt"])
def test_shipped_tree_compiles_as_reviewed(tree, suffix):
    assert_matches_golden(tree, GOLDEN / f"{tree.stem}{suffix}")


def test_golden_files_match_shipped_trees():
    assert {path.stem for path in GOLDEN.glob("*.json")} == {tree.stem for tree in SHIPPED}


def test_changed_tree_is_reported_with_a_difference(tmp_path, monkeypatch):
    monkeypatch.delenv(RENEW, raising=False)
    changed = tmp_path / "changed.xml"
    text = Path("trees/search_and_rescue.xml").read_text(encoding="utf-8")
    changed.write_text(text.replace('name="Patrol"', 'name="Tour"'), encoding="utf-8")
    with pytest.raises(AssertionError, match=r"(?s)-    \{-\} Patrol\n\+    \{-\} Tour"):
        assert_matches_golden(changed, GOLDEN / "search_and_rescue.txt")


def test_missing_golden_file_names_how_to_write_it(tmp_path, monkeypatch):
    monkeypatch.delenv(RENEW, raising=False)
    with pytest.raises(AssertionError, match=RENEW):
        assert_matches_golden("trees/search_and_rescue.xml", tmp_path / "new.json")


def test_tree_is_compared_with_renewed_file(tmp_path, monkeypatch):
    golden = tmp_path / "sub" / "new.json"
    monkeypatch.setenv(RENEW, "1")
    assert_matches_golden("trees/search_and_rescue.xml", golden)
    monkeypatch.delenv(RENEW)
    assert_matches_golden("trees/search_and_rescue.xml", golden)
