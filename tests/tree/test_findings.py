"""Tests of the display of findings in a terminal."""

import pickle

import pytest

from sar_compiler.tree.diagnostic import Diagnostic, Severity, TreeError
from sar_compiler.tree.xml import parse_xml


def rendered(text, find, **advice):
    """Render a finding about the element or attribute value that `find` names."""
    tree = parse_xml(text, "trees/mission.xml")
    element = next(e for e in tree.root.iterate() if e.tag == find.split("@")[0])
    span = element.value_span(find.split("@")[1]) if "@" in find else element.tag_span()
    return Diagnostic("unknown-node", "there is no node 'Sey'", tree.source, span, **advice).render()


def test_carets_underline_tag_and_location_is_at_its_bracket():
    assert rendered('<root>\n      <Sey message="hi"/>\n</root>', "Sey", suggestion="Say") == (
        "trees/mission.xml:2:7: error[unknown-node]: there is no node 'Sey'\n"
        '    2 |       <Sey message="hi"/>\n'
        "      |        ^^^ did you mean 'Say'?"
    )


def test_carets_underline_value():
    lines = rendered('<root><A b="ture"/></root>', "A@b").splitlines()
    assert lines[2] == "      |             ^^^^"


def test_empty_value_gets_one_caret():
    lines = rendered('<root><A b=""/></root>', "A@b").splitlines()
    assert lines[2] == "      |             ^"


def test_tabs_are_kept_so_that_carets_line_up():
    lines = rendered("<root>\n\t\t<Sey/></root>", "Sey").splitlines()
    assert lines[2] == "      | \t\t ^^^"


def test_hint_is_shown_without_suggestion():
    assert rendered("<root><Sey/></root>", "Sey", hint="install it").endswith("^^^ install it")


def test_long_line_is_cut_around_finding():
    text = "<root>" + "<A/>" * 100 + "<Sey/>" + "<A/>" * 100 + "</root>"
    place, line, carets = rendered(text, "Sey").splitlines()
    assert place.startswith("trees/mission.xml:1:407:")
    assert len(line) < 140
    assert line[carets.index("^") : carets.rindex("^") + 1] == "Sey"


def test_control_characters_in_source_line_are_escaped():
    text = '<root><A b="\u202eab\u200bc"/>\t<Sey/></root>'
    place, line, carets = rendered(text, "A@b", hint="\x1b[31mred").splitlines()
    assert place.startswith("trees/mission.xml:1:13:")
    assert line == '    1 | <root><A b="\\u202eab\\u200bc"/>\t<Sey/></root>'
    assert carets == "      |             ^^^^^^^^^^^^^^^ \\x1b[31mred"
    assert rendered(text, "Sey").splitlines()[2] == "      |                               \t ^^^"


def test_control_characters_are_escaped_only_when_rendered():
    source = parse_xml("<root/>", "a\x1b.xml").source
    finding = Diagnostic("unknown-node", "there is no node '\x9b2J\ufeff'", source, source.span(0, 1))
    assert finding.render().startswith(
        "a\\x1b.xml:1:1: error[unknown-node]: there is no node '\\x9b2J\\ufeff'\n"
    )
    assert finding.message == "there is no node '\x9b2J\ufeff'"


def test_very_long_value_is_cut_in_messages_and_advice():
    source = parse_xml("<root/>").source
    value = "x" * 100_000
    message = f"a: '{value}' is not a number"
    finding = Diagnostic("wrong-value", message, source, source.span(0, 1), suggestion=value, hint=value)
    assert len(finding.message) < 500
    assert finding.message.endswith("x' is not a number")
    assert finding.suggestion == value
    assert len(finding.render()) < 1500


def test_suggestion_with_quotation_marks_is_quoted_with_other_ones():
    assert rendered("<root><Sey/></root>", "Sey", suggestion="'two'").endswith("""did you mean "'two'"?""")
    assert rendered("<root><Sey/></root>", "Sey", suggestion="""'a' "b\"""").endswith(
        """did you mean `'a' "b"`?"""
    )


def test_finding_has_severity_of_its_code_by_default():
    root = parse_xml("<root/>", "a.xml").root
    assert root.finding("stray-text", "why").severity is Severity.WARNING
    assert root.finding("stray-text", "why", severity=Severity.ERROR).severity is Severity.ERROR


@pytest.mark.parametrize("severity", [None, Severity.INFO])
def test_undeclared_finding_code_raises_key_error(severity):
    with pytest.raises(KeyError, match="unknown-nod"):
        parse_xml("<root/>", "a.xml").root.finding("unknown-nod", "why", severity=severity)


def test_tree_error_can_be_pickled():
    with pytest.raises(TreeError) as caught:
        parse_xml("<root><A", "trees/mission.xml")
    copied = pickle.loads(pickle.dumps(caught.value))  # noqa: S301 - our own
    assert str(copied) == str(caught.value)
