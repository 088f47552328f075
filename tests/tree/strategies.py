"""Random trees with everything that a file can contain."""

from hypothesis import strategies as st

from sar_compiler.tree.model import Comment, Element, TreeFile, yaml_comment_text
from sar_compiler.tree.xml import parse_xml

SOURCE = parse_xml("<root/>").source

TAGS = st.sampled_from(["Sequence", "A", "Ä_1", "no", "true", "a.b", "x-y", "ns:Tag"])
ATTRIBUTES = st.sampled_from(["name", "ID", "memory", "_skipIf", "y", "on", "null", "é", "xsi:a", "a.b-c"])

# All characters that XML can represent, with emphasis on those that have a meaning in either form.
ODD = st.sampled_from(" \t\n\r'\"<>&#:-?{}[],|>*!%@`\\=~/._0123456789eExXyn\x85\u2028\ufeff")
ANY = st.characters(exclude_categories=["Cs"], exclude_characters="\ufffe\uffff").filter(
    lambda character: character >= " " or character in "\t\n\r"
)
WORDS = st.sampled_from(
    [
        "no",
        "Yes",
        "on",
        "true",
        "False",
        "null",
        "~",
        "12:30",
        "1e3",
        "0x10",
        "010",
        "1_000",
        "4",
        "-0",
        "0.5",
        "1.50",
        ".inf",
        "2001-01-01",
        "<<",
        "=",
        "- a",
        "? a",
        "a: b",
        "a #b",
        "a:",
        "{key}",
        "{=}",
        "[1]",
        "*a",
        "&a",
        "!a",
        "'a' == b",
        'say "hi"',
        "a := 1;\nb := 2",
        "a\n\n  b\n",
        "\n",
        "a \nb",
        " a",
        "a ",
        "---",
        "...",
        "# a",
        "",
        "a &amp;&amp; b",
        "&#10;",
        "]]>",
        "-->",
        "\\n",
        "C:\\x",
        "a\tb",
        "\ta",
        "%a",
        "@a",
        "`a",
        "1.2.3",
        "😀",
    ]
)
VALUES = WORDS | st.text(ODD | ANY, max_size=12)
SAID = st.lists(st.text(st.sampled_from(list("ab -#&<>:'\"é!")), max_size=8), min_size=1, max_size=3)
COMMENT_TEXTS = SAID.map(yaml_comment_text).filter(lambda text: "--" not in text)


@st.composite
def comments(draw, children):
    """Draw comments that both forms can contain: one beside the tag, others between the children."""
    inner = [
        Comment(text, index)
        for index in range(children + 1)
        for text in draw(st.lists(COMMENT_TEXTS, max_size=2 if draw(st.booleans()) else 0))
    ]
    trailing = draw(st.none() | COMMENT_TEXTS.filter(lambda text: "\n" not in text))
    return (*([Comment(trailing, trailing=True)] if trailing is not None else []), *inner)


@st.composite
def elements(draw, children=st.just(())):  # noqa: B008 - a strategy is a value
    inner = tuple(draw(children))
    attributes = draw(st.dictionaries(ATTRIBUTES, VALUES, max_size=3))
    said = draw(comments(len(inner)))
    return Element(draw(TAGS), attributes, inner, SOURCE, 1, 1, comments=said)


TREES = st.recursive(elements(), lambda inner: elements(st.lists(inner, max_size=3)), max_leaves=6)


@st.composite
def tree_files(draw):
    said = [Comment(text, index) for index in (0, 1) for text in draw(st.lists(COMMENT_TEXTS, max_size=2))]
    return TreeFile(SOURCE, draw(TREES), tuple(said))


def everything(tree_file):
    """Return the whole content of a file, with the order of attributes and with comments, for comparison."""
    said = [(comment.text, comment.index) for comment in tree_file.comments]
    return said, _all_of(tree_file.root)


def _all_of(element):
    said = [(one.text, one.index, one.attribute, one.trailing) for one in element.comments]
    children = [_all_of(child) for child in element.children]
    return element.tag, list(element.attributes.items()), element.text, said, children
