"""Tests of finding shipped files."""

from pathlib import Path

import pytest

from sar_compiler.resources import ResourceError, find, not_found_message, shared_file_path, shipped_root


def test_shipped_file_is_found_by_kind_and_name():
    assert shared_file_path("trees", "search_and_rescue.xml").read_text(encoding="utf-8").startswith("<?xml")


def test_unknown_shipped_file_error_lists_existing_ones():
    with pytest.raises(
        ResourceError,
        match=r"has no shipped file 'x\.xml' \(existing files: failsafes\.xml, search_and_rescue\.xml",
    ):
        shared_file_path("trees", "x.xml")


def test_bare_name_means_shipped_file():
    assert find("trees", "search_and_rescue", ".xml") == shared_file_path("trees", "search_and_rescue.xml")


@pytest.mark.parametrize("name", ["mine.xml", "folder/search_and_rescue", "nothing_shipped"])
def test_other_names_are_paths(name):
    assert find("trees", name, ".xml") == Path(name)


def test_file_in_current_folder_precedes_shipped_file(tmp_path, monkeypatch):
    (tmp_path / "search_and_rescue").touch()
    monkeypatch.chdir(tmp_path)
    assert find("trees", "search_and_rescue", ".xml") == Path("search_and_rescue")


def test_subfolder_does_not_hide_shipped_file(tmp_path, monkeypatch):
    (tmp_path / "search_and_rescue").mkdir()
    monkeypatch.chdir(tmp_path)
    assert find("trees", "search_and_rescue", ".xml") == shared_file_path("trees", "search_and_rescue.xml")


def test_message_for_unknown_name_lists_known_names():
    assert not_found_message("worlds", "emty", ".yaml") == (
        "there is no world file 'emty', nor a shipped world of that name "
        "(shipped: disaster_zone, empty, offices); did you mean 'empty'?"
    )


def test_shipped_root_of_checkout_is_the_folder_around_the_package(tmp_path):
    (tmp_path / "package.xml").touch()
    assert shipped_root(tmp_path / "sar_compiler") == tmp_path


@pytest.mark.parametrize(
    "library",
    ["lib/python3.12/site-packages", "local/lib/python3.12/dist-packages", "lib/python3/dist-packages", "."],
)
def test_shipped_root_of_installation_is_its_share_folder(tmp_path, library):
    share = tmp_path / "share" / "sar_compiler"
    share.mkdir(parents=True)
    (share / "package.xml").touch()
    assert shipped_root(tmp_path / library / "sar_compiler") == share


def test_nearer_installation_is_used(tmp_path):
    for prefix in (tmp_path, tmp_path / "environment"):
        (prefix / "share" / "sar_compiler").mkdir(parents=True)
        (prefix / "share" / "sar_compiler" / "package.xml").touch()
    package = tmp_path / "environment" / "lib" / "python3.12" / "site-packages" / "sar_compiler"
    assert shipped_root(package) == tmp_path / "environment" / "share" / "sar_compiler"


def test_package_without_shipped_files_asks_for_reinstallation(tmp_path):
    with pytest.raises(ResourceError, match=f"no folder above the package in {tmp_path} .* Reinstall"):
        shipped_root(tmp_path)


def test_error_states_that_no_file_of_a_kind_is_shipped():
    with pytest.raises(ResourceError, match="existing files: none"):
        shared_file_path("moons", "luna.yaml")


@pytest.mark.parametrize(
    ("kind", "file"), [("trees", "scout.xml"), ("trees", "scout.yaml"), ("worlds", "scout.yaml")]
)
def test_file_named_without_suffix_is_suggested_with_it(tmp_path, monkeypatch, kind, file):
    monkeypatch.chdir(tmp_path)
    tmp_path.joinpath(file).touch()
    suffix = ".xml" if kind == "trees" else ".yaml"
    assert not_found_message(kind, "scout", suffix).endswith(f"; did you mean '{file}'?")
