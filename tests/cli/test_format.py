"""Tests of `sar-compile format`."""

from pathlib import Path

import pytest

from tests.cli import command_runner

ROUGH = {"xml": "<root a='1'><!-- why -->\n<A/></root>", "yaml": "root: {a: '1', children: [A]}  # why\n"}
DECLARED = {
    "utf-8": "UTF-8",
    "utf-8-sig": "UTF-8",
    "utf-16": "UTF-16",
    "utf-16-be": "UTF-16",
    "iso-8859-1": "ISO-8859-1",
}
NEAT = {
    "xml": '<?xml version="1.0" encoding="UTF-8"?>\n<root a="1">  <!-- why -->\n  <A/>\n</root>\n',
    "yaml": "root:\n  a: 1\n  children:\n    - A\n# why\n",
}


def run(capsys, *arguments):
    return command_runner.run(capsys, "format", *arguments)


@pytest.fixture(params=ROUGH)
def unformatted_file(request, tmp_path):
    path = tmp_path / f"tree.{request.param}"
    path.write_text(ROUGH[request.param], encoding="utf-8")
    path.chmod(0o640)
    return path


def test_file_is_rewritten_in_its_form_with_comments_and_permissions(capsys, unformatted_file):
    assert run(capsys, unformatted_file) == (0, f"{unformatted_file}: rewritten\n", "")
    assert unformatted_file.read_text(encoding="utf-8") == NEAT[unformatted_file.suffix[1:]]
    assert unformatted_file.stat().st_mode & 0o777 == 0o640


def test_second_format_changes_nothing(capsys, unformatted_file):
    run(capsys, unformatted_file)
    before = unformatted_file.stat()
    assert run(capsys, unformatted_file) == (0, "", "")
    assert (unformatted_file.stat().st_ino, unformatted_file.stat().st_mtime_ns) == (
        before.st_ino,
        before.st_mtime_ns,
    )


def test_check_names_files_to_change_and_changes_nothing(capsys, unformatted_file):
    assert run(capsys, "--check", unformatted_file) == (
        1,
        f"{unformatted_file}: is not in canonical form\n",
        "",
    )
    assert unformatted_file.read_text(encoding="utf-8") == ROUGH[unformatted_file.suffix[1:]]


def test_shipped_trees_are_in_canonical_form(capsys):
    assert run(capsys, "--check", *sorted(Path("trees").iterdir())) == (0, "", "")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "iso-8859-1"])
def test_encoding_byte_order_mark_and_line_ends_are_kept(capsys, unformatted_file, encoding, end):
    form = unformatted_file.suffix[1:]
    if (form, encoding) == ("yaml", "iso-8859-1"):
        pytest.skip("YAML is Unicode")
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    declared = "" if form == "yaml" else f'<?xml version="1.0" encoding="{DECLARED[encoding]}"?>'
    before = f"{declared}\n{ROUGH[form].replace('why', 'wä€r' if 'utf' in encoding else 'wär')}"
    unformatted_file.write_bytes((mark + before.replace("\n", end)).encode(encoding))
    neat = NEAT[form].replace("why", "wä€r" if "utf" in encoding else "wär")
    after = mark + neat.replace("UTF-8", DECLARED[encoding]).replace("\n", end)
    assert run(capsys, unformatted_file) == (0, f"{unformatted_file}: rewritten\n", "")
    assert unformatted_file.read_bytes() == after.encode(encoding)
    assert run(capsys, "--check", unformatted_file) == (0, "", "")


def test_character_outside_file_encoding_stays_reference(capsys, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_bytes(b'<?xml version="1.0" encoding="latin-1"?><root a="&#8364;\xe4"/>')
    assert run(capsys, path)[0] == 0
    assert path.read_bytes() == b'<?xml version="1.0" encoding="latin-1"?>\n<root a="&#8364;\xe4"/>\n'


def test_malformed_file_is_unchanged_and_others_are_rewritten(capsys, unformatted_file, tmp_path):
    broken = tmp_path / "broken.xml"
    broken.write_text("<root>", encoding="utf-8")
    status, out, err = run(capsys, broken, unformatted_file)
    assert (status, out) == (1, f"{unformatted_file}: rewritten\n")
    assert f"{broken}:1:7: error[malformed-xml]" in err
    assert broken.read_text(encoding="utf-8") == "<root>"


def test_stray_text_is_reported_and_kept(capsys, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text("<root> text </root>", encoding="utf-8")
    status, _, err = run(capsys, path)
    assert (status, "stray-text" in err) == (1, True)
    assert path.read_text(encoding="utf-8") == "<root> text </root>"


def test_missing_file_has_status_2(capsys, unformatted_file):
    status, out, err = run(capsys, "nowhere.xml", unformatted_file)
    assert (status, out) == (2, f"{unformatted_file}: rewritten\n")
    assert "cannot read nowhere.xml" in err


def test_link_stays_link(capsys, unformatted_file, tmp_path):
    link = tmp_path / f"link{unformatted_file.suffix}"
    link.symlink_to(unformatted_file)
    assert run(capsys, link)[0] == 0
    assert link.is_symlink()
    assert unformatted_file.read_text(encoding="utf-8") == NEAT[unformatted_file.suffix[1:]]
