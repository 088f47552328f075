"""Tests of `--fix`: it fixes unambiguous errors, and changes nothing else."""

import json
import re

import jsonschema
import pytest

from sar_compiler.cli.compile import main
from sar_compiler.tree.guessing import is_typo
from tests.cli.test_validate import SARIF
from tests.trees import document

FIXED = {
    "a special attribute in the wrong case": (
        '<NavigateToZone _skipif="true"/>',
        '<NavigateToZone _skipIf="true"/>',
    ),
    "an attribute of every control": (
        '<Sequence memroy="true"><ZonesRemaining/><LogNoDetection/></Sequence>',
        '<Sequence memory="true"><ZonesRemaining/><LogNoDetection/></Sequence>',
    ),
    "a leaf's attribute in the wrong case": (
        '<Retry NUM_failures="2"><NavigateToZone/></Retry>',
        '<Retry num_failures="2"><NavigateToZone/></Retry>',
    ),
    "outputs without a key": (
        """<LoopInt queue="1" value=''><LoopBool value = "{}" queue="true"><ZonesRemaining/></LoopBool></LoopInt>""",
        '<LoopInt queue="1"><LoopBool queue="true"><ZonesRemaining/></LoopBool></LoopInt>',
    ),
    "true with a slip": (
        '<Sequence memory="ture"><ZonesRemaining/><LogNoDetection/></Sequence>',
        '<Sequence memory="true"><ZonesRemaining/><LogNoDetection/></Sequence>',
    ),
    "a policy in the wrong case": (
        '<NavigateToZone oneshot="on_completion"/>',
        '<NavigateToZone oneshot="ON_COMPLETION"/>',
    ),
    "a key with one brace": (
        '<Timeout duration="{@patience"><NavigateToZone/></Timeout>',
        '<Timeout duration="{@patience}"><NavigateToZone/></Timeout>',
    ),
    "operators of other languages": (
        '<ScriptCondition code="@a === 1 and @b &lt;&gt; 2"/>',
        '<ScriptCondition code="@a == 1 &amp;&amp; @b != 2"/>',
    ),
    "quotation marks within others": (
        "<ScriptCondition code='@a == \"x\"'/>",
        "<ScriptCondition code='@a == &apos;x&apos;'/>",
    ),
}
NOT_FIXED = {
    "a tag": "<NavigateToZne/>",
    "a leaf's attribute that is only near": '<Retry num_failure="2"><NavigateToZone/></Retry>',
    "a number with a unit": '<Timeout duration="60 sec"><NavigateToZone/></Timeout>',
    "a reference": '<Sequence><DetectSurvivor/><NotifyBase detect_node="DetectSurvivr"/></Sequence>',
    "a word that binds differently": '<ScriptCondition code="not @a == 1"/>',
    "an operator that has two readings": '<Script code="@a =+ 1"/>',
    "a product that has two readings": '<Script code="@a =* 2"/>',
    "a quotient that has two readings": '<Script code="@a =/ 2"/>',
    "a comparison that is an arrow elsewhere": '<ScriptCondition code="@a => 1"/>',
}


def fix(path):
    return main(["validate", "--fix", str(path)])


@pytest.mark.parametrize("name", FIXED)
def test_typo_is_fixed(name, tmp_path, capsys):
    wrong, right = FIXED[name]
    path = tmp_path / "tree.xml"
    path.write_text(document(wrong), encoding="utf-8")
    assert fix(path) == 0
    assert path.read_text(encoding="utf-8") == document(right)
    assert "fixed[" in capsys.readouterr().out


@pytest.mark.parametrize("name", NOT_FIXED)
def test_ambiguous_error_is_not_fixed(name, tmp_path, capsys):
    path = tmp_path / "tree.xml"
    path.write_text(document(NOT_FIXED[name]), encoding="utf-8")
    assert fix(path) == 1
    assert path.read_text(encoding="utf-8") == document(NOT_FIXED[name])
    assert "fixed[" not in capsys.readouterr().out


def test_fix_is_reported_with_location(tmp_path, capsys):
    path = tmp_path / "tree.xml"
    path.write_text(document('<NavigateToZone _onsuccess="@goal := 1"/>'), encoding="utf-8")
    fix(path)
    out = capsys.readouterr().out
    assert out.startswith(f"{path}:3:17: fixed[unknown-attribute]: _onsuccess -> _onSuccess\n")


def test_second_fix_changes_nothing(tmp_path, capsys):
    path = tmp_path / "tree.xml"
    path.write_text(
        document('<Sequence memroy="ture"><Xyzzy/><LogNoDetection/></Sequence>'), encoding="utf-8"
    )
    fix(path)
    once = path.read_bytes()
    capsys.readouterr()
    fix(path)
    assert path.read_bytes() == once
    assert "fixed[" not in capsys.readouterr().out


YAML = (
    "# ends with CRLF\r\nroot:\r\n  BTCPP_format: 4\r\n  children:\r\n    - BehaviorTree:\r\n        ID: Main\r\n"
    "        children:\r\n          - {}  # why\r\n"
)
IN_YAML = {
    "an output beside others": (
        "LoopInt: {queue: '1', value: '', children: [ZonesRemaining]}",
        ", value: ''",
        "",
    ),
    "an output before others": (
        'LoopInt: {"value": "{}", queue: \'1\', children: [ZonesRemaining]}',
        '"value": "{}", ',
        "",
    ),
    "an output in its line": (
        "LoopInt:\r\n              value: ''\r\n              queue: '1'\r\n              children: [ZonesRemaining]",
        "              value: ''\r\n",
        "",
    ),
    "a plain value": ("Sequence: {memory: ture, children: [ZonesRemaining, LogNoDetection]}", "ture", "true"),
    "a script in single quotes": (
        "ScriptCondition: {code: '@a == 1 and @b == ''x'''}",
        "and",
        "&&",
    ),
    "a script in double quotes": ('ScriptCondition: {code: "@a == 1 and @b"}', "and", "&&"),
    "a key without its quotes": (
        "Timeout: {duration: {patience}, children: [NavigateToBase]}",
        "{patience}",
        "'{patience}'",
    ),
}


@pytest.mark.parametrize("name", IN_YAML)
def test_yaml_is_fixed_in_place(name, tmp_path):
    node, wrong, right = IN_YAML[name]
    path = tmp_path / "tree.yaml"
    path.write_bytes(YAML.format(node).encode())
    fix(path)
    assert path.read_bytes().decode() == YAML.format(node.replace(wrong, right, 1))


def test_plain_yaml_scalar_gets_quotes_if_fix_requires_them(tmp_path):
    node = "Timeout:\r\n              duration: {}\r\n              children: [NavigateToBase]"
    path = tmp_path / "tree.yaml"
    path.write_bytes(YAML.format(node.format("patience}")).encode())
    fix(path)
    assert path.read_bytes().decode() == YAML.format(node.format("'{patience}'"))


@pytest.mark.parametrize(
    ("encoding", "declared", "mark"),
    [("utf-8", "", b"\xef\xbb\xbf"), ("utf-16-le", "", b"\xff\xfe"), ("iso-8859-1", "ISO-8859-1", b"")],
)
def test_encoding_byte_order_mark_and_line_ends_are_kept(encoding, declared, mark, tmp_path):
    head = f'<?xml version="1.0" encoding="{declared}"?>' if declared else ""
    text = head + document('<!-- Straße -->\r\n<NavigateToZone\t_skipif = "true" />').replace("\n", "\r\n")
    path = tmp_path / "tree.xml"
    path.write_bytes(mark + text.encode(encoding))
    assert fix(path) == 0
    assert path.read_bytes() == mark + text.replace("skipif", "skipIf").encode(encoding)


def offset(text, line, column):
    """Return the offset of a location in a text, whose columns count UTF-16 units."""
    start = [0, *(end.end() for end in re.finditer("\r\n|\r|\n", text))][line - 1]
    units = text[start:].encode("utf-16-le")[: 2 * (column - 1)]
    return start + len(units.decode("utf-16-le"))


def apply_sarif(path, capsys):
    """Apply the fixes of a SARIF log according to the standard; return whether there were any."""
    capsys.readouterr()
    main(["validate", "--no-deep", "--format", "sarif", str(path)])
    log = json.loads(capsys.readouterr().out)
    jsonschema.validate(log, SARIF)
    text = path.read_bytes().decode()
    changes = []
    for fix in (fix for result in log["runs"][0]["results"] for fix in result.get("fixes", ())):
        [change] = fix["artifactChanges"]
        assert change["artifactLocation"]["uri"] == path.as_uri()
        for one in change["replacements"]:
            region = one["deletedRegion"]
            start = offset(text, region["startLine"], region["startColumn"])
            end = offset(text, region["endLine"], region["endColumn"])
            changes.append((start, end, one["insertedContent"]["text"]))
    for start, end, new in sorted(changes, reverse=True):
        text = text[:start] + new + text[end:]
    path.write_bytes(text.encode())
    return bool(changes)


SARIF_FILES = {
    **{f"{name}.xml": document(f"<!-- \U0001f600 -->{wrong}") for name, (wrong, _) in FIXED.items()},
    **{f"{name}.yaml": YAML.format(node) for name, (node, *_) in IN_YAML.items()},
    "several in a line.xml": document(
        '<Sequence name="\U0001f600" memroy="ture"><NavigateToZone _skipif="true"/></Sequence>'
    ),
    "characters.xml": document("<ScriptCondition code=\"@a && @b < 'x' and '\U0001f600' <> 'y'\"/>"),
    "left.xml": document("<NavigateToZne/>"),
}


@pytest.mark.parametrize("name", SARIF_FILES)
def test_sarif_fixes_give_same_bytes_as_fix_option(name, tmp_path, capsys):
    path, other = tmp_path / name, tmp_path / f"other {name}"
    path.write_bytes(SARIF_FILES[name].encode())
    other.write_bytes(SARIF_FILES[name].encode())
    rounds = 0
    while apply_sarif(path, capsys):
        rounds += 1
    fix(other)
    assert path.read_bytes() == other.read_bytes()
    assert bool(rounds) == (name != "left.xml")


def test_included_file_that_is_not_named_is_not_changed(tmp_path, capsys):
    inner = document('<NavigateToZone _skipif="true"/>', main="Inner")
    (tmp_path / "inner.xml").write_text(inner, encoding="utf-8")
    outer = document('<SubTree ID="Inner"/>').replace("<Beh", '<include path="inner.xml"/><Beh')
    (tmp_path / "outer.xml").write_text(outer, encoding="utf-8")
    assert fix(tmp_path / "outer.xml") == 1
    assert (tmp_path / "inner.xml").read_text(encoding="utf-8") == inner


@pytest.mark.parametrize(
    ("written", "meant", "slip"),
    [
        ("_skipif", "_skipIf", True),
        ("memroy", "memory", True),
        ("memry", "memory", True),
        ("memoryy", "memory", True),
        ("memary", "memory", True),
        ("flase", "false", True),
        ("memo", "memory", False),
        ("zone1", "zone2", False),
        ("yes", "true", False),
        ("id", "ID", True),
        ("if", "ID", False),
    ],
)
def test_typo_is_one_letter_or_two_swapped_letters(written, meant, slip):
    assert is_typo(written, meant) is slip
