"""Where shipped files are found."""

from pathlib import Path

import pytest

from sar_compiler import resources
from sar_compiler.resources import ResourceError, find, shipped


def test_a_shipped_file_is_found_by_kind_and_name():
    assert shipped("trees", "search_and_rescue.xml").read_text(encoding="utf-8").startswith("<?xml")


def test_a_file_that_is_not_shipped_is_an_error_that_lists_those_that_are():
    with pytest.raises(
        ResourceError, match=r"no file 'x\.xml' is shipped in .* \(there is: search_and_rescue\.xml"
    ):
        shipped("trees", "x.xml")


def test_a_bare_word_means_the_shipped_file_of_that_name():
    assert find("trees", "search_and_rescue", ".xml") == shipped("trees", "search_and_rescue.xml")


@pytest.mark.parametrize("name", ["mine.xml", "folder/search_and_rescue", "nothing_shipped"])
def test_anything_else_is_a_path(name):
    assert find("trees", name, ".xml") == Path(name)


def test_a_file_in_the_current_folder_comes_before_a_shipped_one(tmp_path, monkeypatch):
    (tmp_path / "search_and_rescue").touch()
    monkeypatch.chdir(tmp_path)
    assert find("trees", "search_and_rescue", ".xml") == Path("search_and_rescue")


def test_an_installed_package_has_its_files_in_the_environment(tmp_path, monkeypatch):
    (tmp_path / "trees").mkdir()
    monkeypatch.setattr(resources, "_CHECKOUT", tmp_path / "nowhere")
    monkeypatch.setattr(resources, "_INSTALLED", tmp_path)
    assert resources.shipped_root() == tmp_path
    with pytest.raises(ResourceError, match="there is: nothing"):
        shipped("trees", "a.xml")
