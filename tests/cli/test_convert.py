"""Tests of `sar-compile convert`."""

import subprocess
import sys
from pathlib import Path

import pytest

from sar_compiler.cli.compile import main
from tests.cli import command_runner

SHIPPED = {form: Path(f"trees/search_and_rescue.{form}") for form in ("xml", "yaml")}


def run(capsys, *arguments):
    return command_runner.run(capsys, "convert", *arguments)


@pytest.mark.parametrize(
    ("name", "form"), [("xml", "yaml"), ("yaml", "xml"), ("xml", "xml"), ("yaml", "yaml")]
)
def test_shipped_tree_converts_from_each_form_to_each_form(capsysbinary, name, form):
    assert main(["convert", str(SHIPPED[name]), "--to", form]) == 0
    assert capsysbinary.readouterr().out == SHIPPED[form].read_bytes()


def test_shipped_tree_can_be_given_by_name(capsys):
    status, out, _ = run(capsys, "search_and_rescue", "--to", "yaml")
    assert (status, out) == (0, SHIPPED["yaml"].read_text(encoding="utf-8"))


def test_output_file_is_replaced_and_keeps_its_permissions(capsys, tmp_path):
    output = tmp_path / "tree.yaml"
    output.write_text("what was there", encoding="utf-8")
    output.chmod(0o640)
    assert run(capsys, SHIPPED["xml"], "--to", "yaml", "-o", output) == (0, "", "")
    assert output.read_bytes() == SHIPPED["yaml"].read_bytes()
    assert output.stat().st_mode & 0o777 == 0o640
    assert list(tmp_path.iterdir()) == [output]


def test_input_file_is_not_overwritten(capsys, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text("<root/>", encoding="utf-8")
    status, out, err = run(capsys, path, "--to", "yaml", "-o", tmp_path / "." / "tree.xml")
    assert (status, out) == (2, "")
    assert "is the input file. Name another file with -o" in err
    assert path.read_text(encoding="utf-8") == "<root/>"


def test_moved_comment_is_reported_on_standard_error(capsys, tmp_path):
    path = tmp_path / "tree.yaml"
    path.write_text("root:\n  a: 1  # why\n", encoding="utf-8")
    status, out, err = run(capsys, path, "--to", "xml")
    assert status == 0
    assert "<!-- why -->" in out
    assert err.startswith(
        f"{path}:2:3: info[moved]: in XML, the comment at the attribute 'a' moves before the element: 'why'"
    )


def test_unknown_nodes_are_converted(capsys, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text("<root><Unknown/></root>", encoding="utf-8")
    assert run(capsys, path, "--to", "yaml") == (0, "root:\n  children:\n    - Unknown\n", "")


def test_malformed_file_has_status_1_with_findings_and_no_output(capsys, tmp_path):
    path, output = tmp_path / "tree.yaml", tmp_path / "tree.xml"
    path.write_text("root:\n  a: 1\n  a: 2\n", encoding="utf-8")
    status, out, err = run(capsys, path, "--to", "xml", "-o", output)
    assert (status, out) == (1, "")
    assert "3:3: error[duplicate-key]" in err
    assert not output.exists()


def test_missing_input_or_unwritable_output_has_status_2(capsys, tmp_path):
    assert run(capsys, "nowhere.xml", "--to", "yaml")[0] == 2
    status, _, err = run(capsys, SHIPPED["xml"], "--to", "yaml", "-o", tmp_path / "nowhere" / "tree.yaml")
    assert (status, "No such file or directory" in err) == (2, True)


def test_unknown_form_has_status_2():
    done = subprocess.run(
        [sys.executable, "-m", "sar_compiler.cli.compile", "convert", "x.xml", "--to", "json"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "invalid choice: 'json'" in done.stderr
