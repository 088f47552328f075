"""Which nodes the sections of a parameter file are for."""

import pytest

from sar_compiler.missions.parameter_file import (
    ParameterFileError,
    check_parameter_file,
    read_parameter_file,
    sections_elsewhere,
)
from sar_compiler.missions.parameter_reader import ParameterReader, report_unused_files

NODE = "/robot1/search_and_rescue"


def file_for(folder, *names):
    path = folder / f"{len(list(folder.iterdir()))}.yaml"
    text = "".join(f"{name}:\n  ros__parameters: {{x: 1}}\n" for name in names)
    path.write_text(text, encoding="utf-8")
    check_parameter_file(path)
    return path


@pytest.mark.parametrize(
    "name", ["/**", NODE, "/robot1/*", "/*/search_and_rescue", "/**/search_and_rescue", "/robot1/**"]
)
def test_nothing_is_said_of_a_file_with_a_section_for_the_node(tmp_path, name):
    assert sections_elsewhere([file_for(tmp_path, "/other", name)], NODE) == ""


@pytest.mark.parametrize(
    "name", ["/search_and_rescue", "search_and_rescue", "/robot2/search_and_rescue", "/*", "/robot1"]
)
def test_a_file_for_other_nodes_is_told_from_the_nodes_name(tmp_path, name):
    assert sections_elsewhere([file_for(tmp_path, name)], NODE) == (
        f"the file's sections are for /{name.lstrip('/')}, but this node is {NODE}"
    )


def test_a_node_below_a_namespace_has_the_name_of_both(tmp_path):
    path = tmp_path / "nested.yaml"
    path.write_text("robot2:\n  search_and_rescue:\n    ros__parameters: {x: 1}\n", encoding="utf-8")
    assert "sections are for /robot2/search_and_rescue," in sections_elsewhere([path], NODE)


def test_of_several_files_one_for_the_node_is_enough(tmp_path):
    others, own = file_for(tmp_path, "/a", "/b"), file_for(tmp_path, NODE)
    assert sections_elsewhere([others, own], NODE) == ""
    assert sections_elsewhere([others, file_for(tmp_path, "/c")], NODE) == (
        f"the files' sections are for /a, /b, /c, but this node is {NODE}"
    )


def test_without_a_file_there_is_nothing_to_say():
    assert sections_elsewhere([], NODE) == ""


@pytest.mark.parametrize(
    "written", ["ros_parameters", "ros__parameter", "Ros_Parameters", "ros___parameters"]
)
@pytest.mark.parametrize("below", ["{zone_order: [a], zones: {a: {x: 1.0}}}", "3"])
def test_a_section_that_is_misspelt_is_one_mistake_that_says_how_it_is_spelt(tmp_path, written, below):
    path = tmp_path / "params.yaml"
    path.write_text(f"/**:\n  {written}: {below}\n", encoding="utf-8")
    with pytest.raises(ParameterFileError) as caught:
        check_parameter_file(path)
    assert str(caught.value) == (
        f"{path}:2:3: '{written}': did you mean 'ros__parameters' (two underscores)?"
    )


def test_a_node_may_be_called_nearly_like_the_section(tmp_path):
    file_for(tmp_path, "ros_parameters")


def unread(path, *read):
    reader = ParameterReader.from_files(read_parameter_file(path, NODE), [path], NODE)
    return report_unused_files(reader, read)


def test_a_file_of_which_nothing_is_read_is_reported_with_what_would_be(tmp_path):
    elsewhere = file_for(tmp_path, "/search_and_rescue")
    [note] = unread(elsewhere, "x")
    assert note.startswith(
        "no parameter of the file is used: the file's sections are for /search_and_rescue,"
    )
    assert note.endswith(f"this node is {NODE}. Write '/**:' above the section")
    own = file_for(tmp_path, NODE)
    [note] = unread(own, "tick_rate_hz", "zones")
    assert (
        note
        == f"{own}:2:21: no parameter of the file is used by the run. The file has x, and the run uses tick_rate_hz, zones"
    )


def test_a_file_of_which_something_is_read_is_not_reported(tmp_path):
    assert unread(file_for(tmp_path, NODE), "x") == []
    assert report_unused_files(ParameterReader({"speed": 1.0}), ["x"]) == []
