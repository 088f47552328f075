"""Tests of the nodes to which the sections of a parameter file apply."""

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
def test_file_with_section_for_node_has_no_note(tmp_path, name):
    assert sections_elsewhere([file_for(tmp_path, "/other", name)], NODE) == ""


@pytest.mark.parametrize(
    "name", ["/search_and_rescue", "search_and_rescue", "/robot2/search_and_rescue", "/*", "/robot1"]
)
def test_file_for_other_nodes_is_reported(tmp_path, name):
    assert sections_elsewhere([file_for(tmp_path, name)], NODE) == (
        f"the file's sections are for /{name.lstrip('/')}, but this node is {NODE}"
    )


def test_nested_section_name_includes_namespace(tmp_path):
    path = tmp_path / "nested.yaml"
    path.write_text("robot2:\n  search_and_rescue:\n    ros__parameters: {x: 1}\n", encoding="utf-8")
    assert "sections are for /robot2/search_and_rescue," in sections_elsewhere([path], NODE)


def test_one_of_several_files_for_node_is_sufficient(tmp_path):
    others, own = file_for(tmp_path, "/a", "/b"), file_for(tmp_path, NODE)
    assert sections_elsewhere([others, own], NODE) == ""
    assert sections_elsewhere([others, file_for(tmp_path, "/c")], NODE) == (
        f"the files' sections are for /a, /b, /c, but this node is {NODE}"
    )


def test_no_file_has_no_note():
    assert sections_elsewhere([], NODE) == ""


@pytest.mark.parametrize(
    "written", ["ros_parameters", "ros__parameter", "Ros_Parameters", "ros___parameters"]
)
@pytest.mark.parametrize("below", ["{zone_order: [a], zones: {a: {x: 1.0}}}", "3"])
def test_misspelt_section_is_single_error_with_suggestion(tmp_path, written, below):
    path = tmp_path / "params.yaml"
    path.write_text(f"/**:\n  {written}: {below}\n", encoding="utf-8")
    with pytest.raises(ParameterFileError) as caught:
        check_parameter_file(path)
    assert str(caught.value) == (
        f"{path}:2:3: '{written}': did you mean 'ros__parameters' (two underscores)?"
    )


def test_node_name_may_resemble_section_key(tmp_path):
    file_for(tmp_path, "ros_parameters")


def unused_file_notes(path, *read):
    reader = ParameterReader.from_files(read_parameter_file(path, NODE), [path], NODE)
    return report_unused_files(reader, read)


def test_unused_file_is_reported_with_used_parameters(tmp_path):
    elsewhere = file_for(tmp_path, "/search_and_rescue")
    [note] = unused_file_notes(elsewhere, "x")
    assert note.startswith(
        "no parameter of the file is used: the file's sections are for /search_and_rescue,"
    )
    assert note.endswith(f"this node is {NODE}. Write '/**:' above the section")
    own = file_for(tmp_path, NODE)
    [note] = unused_file_notes(own, "tick_rate_hz", "zones")
    assert (
        note
        == f"{own}:2:21: no parameter of the file is used by the run. The file has x, and the run uses tick_rate_hz, zones"
    )


def test_partly_used_file_is_not_reported(tmp_path):
    assert unused_file_notes(file_for(tmp_path, NODE), "x") == []
    assert report_unused_files(ParameterReader({"speed": 1.0}), ["x"]) == []
