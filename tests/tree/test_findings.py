"""How a finding looks on a terminal."""

from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.xml import parse_xml


def rendered(text, find, **advice):
    """Render a finding about the element (or the attribute's value) that is searched for."""
    tree = parse_xml(text, "trees/mission.xml")
    element = next(e for e in tree.root.iterate() if e.tag == find.split("@")[0])
    span = element.value_span(find.split("@")[1]) if "@" in find else element.tag_span()
    return Diagnostic("unknown-node", "no node is called 'Sey'", tree.source, span, **advice).render()


def test_the_carets_stand_under_the_tag_and_the_place_is_that_of_its_bracket():
    assert rendered('<root>\n      <Sey message="hi"/>\n</root>', "Sey", suggestion="Say") == (
        "trees/mission.xml:2:7: error[unknown-node]: no node is called 'Sey'\n"
        '    2 |       <Sey message="hi"/>\n'
        "      |        ^^^ did you mean 'Say'?"
    )


def test_the_carets_stand_under_a_value():
    lines = rendered('<root><A b="ture"/></root>', "A@b").splitlines()
    assert lines[2] == "      |             ^^^^"


def test_an_empty_value_still_gets_a_caret():
    lines = rendered('<root><A b=""/></root>', "A@b").splitlines()
    assert lines[2] == "      |             ^"


def test_tabs_are_kept_so_that_the_carets_line_up():
    lines = rendered("<root>\n\t\t<Sey/></root>", "Sey").splitlines()
    assert lines[2] == "      | \t\t ^^^"


def test_a_hint_stands_where_there_is_nothing_to_suggest():
    assert rendered("<root><Sey/></root>", "Sey", hint="install it").endswith("^^^ install it")


def test_a_long_line_is_cut_around_the_finding():
    text = "<root>" + "<A/>" * 100 + "<Sey/>" + "<A/>" * 100 + "</root>"
    place, line, carets = rendered(text, "Sey").splitlines()
    assert place.startswith("trees/mission.xml:1:407:")
    assert len(line) < 140
    assert line[carets.index("^") : carets.rindex("^") + 1] == "Sey"
