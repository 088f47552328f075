"""Tests of `sar-compile format`."""

from pathlib import Path

import pytest

from tests.cli import running

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
    return running.run(capsys, "format", *arguments)


@pytest.fixture(params=ROUGH)
def rough(request, tmp_path):
    path = tmp_path / f"tree.{request.param}"
    path.write_text(ROUGH[request.param], encoding="utf-8")
    path.chmod(0o640)
    return path


def test_file_is_rewritten_in_its_form_with_comments_and_permissions(capsys, rough):
    assert run(capsys, rough) == (0, f"{rough}: rewritten\n", "")
    assert rough.read_text(encoding="utf-8") == NEAT[rough.suffix[1:]]
    assert rough.stat().st_mode & 0o777 == 0o640


def test_second_format_changes_nothing(capsys, rough):
    run(capsys, rough)
    before = rough.stat()
    assert run(capsys, rough) == (0, "", "")
    assert (rough.stat().st_ino, rough.stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)


def test_check_names_files_to_change_and_changes_nothing(capsys, rough):
    assert run(capsys, "--check", rough) == (1, f"{rough}: is not in canonical form\n", "")
    assert rough.read_text(encoding="utf-8") == ROUGH[rough.suffix[1:]]


def test_shipped_trees_are_in_canonical_form(capsys):
    assert run(capsys, "--check", *sorted(Path("trees").iterdir())) == (0, "", "")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "iso-8859-1"])
def test_encoding_byte_order_mark_and_line_ends_are_kept(capsys, rough, encoding, end):
    form = rough.suffix[1:]
    if (form, encoding) == ("yaml", "iso-8859-1"):
        pytest.skip("YAML is Unicode")
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    declared = "" if form == "yaml" else f'<?xml version="1.0" encoding="{DECLARED[encoding]}"?>'
    before = f"{declared}\n{ROUGH[form].replace('why', 'wä€r' if 'utf' in encoding else 'wär')}"
    rough.write_bytes((mark + before.replace("\n", end)).encode(encoding))
    neat = NEAT[form].replace("why", "wä€r" if "utf" in encoding else "wär")
    after = mark + neat.replace("UTF-8", DECLARED[encoding]).replace("\n", end)
    assert run(capsys, rough) == (0, f"{rough}: rewritten\n", "")
    assert rough.read_bytes() == after.encode(encoding)
    assert run(capsys, "--check", rough) == (0, "", "")


def test_character_outside_file_encoding_stays_reference(capsys, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_bytes(b'<?xml version="1.0" encoding="latin-1"?><root a="&#8364;\xe4"/>')
    assert run(capsys, path)[0] == 0
    assert path.read_bytes() == b'<?xml version="1.0" encoding="latin-1"?>\n<root a="&#8364;\xe4"/>\n'


def test_malformed_file_is_unchanged_and_others_are_rewritten(capsys, rough, tmp_path):
    broken = tmp_path / "broken.xml"
    broken.write_text("<root>", encoding="utf-8")
    status, out, err = run(capsys, broken, rough)
    assert (status, out) == (1, f"{rough}: rewritten\n")
    assert f"{broken}:1:7: error[malformed-xml]" in err
    assert broken.read_text(encoding="utf-8") == "<root>"


def test_stray_text_is_reported_and_kept(capsys, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text("<root> text </root>", encoding="utf-8")
    status, _, err = run(capsys, path)
    assert (status, "stray-text" in err) == (1, True)
    assert path.read_text(encoding="utf-8") == "<root> text </root>"


def test_missing_file_has_status_2(capsys, rough):
    status, out, err = run(capsys, "nowhere.xml", rough)
    assert (status, out) == (2, f"{rough}: rewritten\n")
    assert "cannot read nowhere.xml" in err


def test_link_stays_link(capsys, rough, tmp_path):
    link = tmp_path / f"link{rough.suffix}"
    link.symlink_to(rough)
    assert run(capsys, link)[0] == 0
    assert link.is_symlink()
    assert rough.read_text(encoding="utf-8") == NEAT[rough.suffix[1:]]
