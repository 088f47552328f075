"""Where shipped files are found."""

from pathlib import Path

import pytest

from sar_compiler.resources import ResourceError, find, not_found_message, shared_file_path, shipped_root


def test_a_shipped_file_is_found_by_kind_and_name():
    assert shared_file_path("trees", "search_and_rescue.xml").read_text(encoding="utf-8").startswith("<?xml")


def test_a_file_that_is_not_shipped_is_an_error_that_lists_those_that_are():
    with pytest.raises(
        ResourceError,
        match=r"has no shipped file 'x\.xml' \(existing files: failsafes\.xml, search_and_rescue\.xml",
    ):
        shared_file_path("trees", "x.xml")


def test_a_bare_word_means_the_shipped_file_of_that_name():
    assert find("trees", "search_and_rescue", ".xml") == shared_file_path("trees", "search_and_rescue.xml")


@pytest.mark.parametrize("name", ["mine.xml", "folder/search_and_rescue", "nothing_shipped"])
def test_anything_else_is_a_path(name):
    assert find("trees", name, ".xml") == Path(name)


def test_a_file_in_the_current_folder_comes_before_a_shipped_one(tmp_path, monkeypatch):
    (tmp_path / "search_and_rescue").touch()
    monkeypatch.chdir(tmp_path)
    assert find("trees", "search_and_rescue", ".xml") == Path("search_and_rescue")


def test_a_folder_in_the_current_folder_does_not_hide_a_shipped_file(tmp_path, monkeypatch):
    (tmp_path / "search_and_rescue").mkdir()
    monkeypatch.chdir(tmp_path)
    assert find("trees", "search_and_rescue", ".xml") == shared_file_path("trees", "search_and_rescue.xml")


def test_a_name_that_means_nothing_gets_those_that_do():
    assert not_found_message("worlds", "emty", ".yaml") == (
        "there is no world file 'emty', nor a shipped world of that name "
        "(shipped: disaster_zone, empty, offices); did you mean 'empty'?"
    )


def test_in_a_checkout_they_are_in_the_folder_around_the_package(tmp_path):
    (tmp_path / "package.xml").touch()
    assert shipped_root(tmp_path / "sar_compiler") == tmp_path


@pytest.mark.parametrize(
    "library",
    ["lib/python3.12/site-packages", "local/lib/python3.12/dist-packages", "lib/python3/dist-packages", "."],
)
def test_an_installed_package_has_its_files_in_the_share_folder_beside_the_library(tmp_path, library):
    share = tmp_path / "share" / "sar_compiler"
    share.mkdir(parents=True)
    (share / "package.xml").touch()
    assert shipped_root(tmp_path / library / "sar_compiler") == share


def test_of_two_installations_the_nearer_one_counts(tmp_path):
    for prefix in (tmp_path, tmp_path / "environment"):
        (prefix / "share" / "sar_compiler").mkdir(parents=True)
        (prefix / "share" / "sar_compiler" / "package.xml").touch()
    package = tmp_path / "environment" / "lib" / "python3.12" / "site-packages" / "sar_compiler"
    assert shipped_root(package) == tmp_path / "environment" / "share" / "sar_compiler"


def test_a_package_without_its_files_says_that_it_has_to_be_installed_again(tmp_path):
    with pytest.raises(ResourceError, match=f"no folder above the package in {tmp_path} .* Reinstall"):
        shipped_root(tmp_path)


def test_where_nothing_of_a_kind_is_shipped_the_error_says_so():
    with pytest.raises(ResourceError, match="existing files: none"):
        shared_file_path("moons", "luna.yaml")


@pytest.mark.parametrize(
    ("kind", "file"), [("trees", "scout.xml"), ("trees", "scout.yaml"), ("worlds", "scout.yaml")]
)
def test_a_file_that_is_named_without_its_ending_is_suggested_with_it(tmp_path, monkeypatch, kind, file):
    monkeypatch.chdir(tmp_path)
    tmp_path.joinpath(file).touch()
    suffix = ".xml" if kind == "trees" else ".yaml"
    assert not_found_message(kind, "scout", suffix).endswith(f"; did you mean '{file}'?")
