"""Counts unused words and contorted phrases in the project's pages, docstrings, messages, options and names.

`python -m tests.docs.prose [KIND]` compares the counts with their ceilings and lists the texts of a kind that were counted. The
words are those in the last column of `docs/glossary.md`. The phrases match `MARKS`. A marked sentence can be good English,
so the ceilings of phrases are percentages. A change may lower a ceiling, but not raise it.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.docs.markdown import prose, tables

GLOSSARY = Path("docs/glossary.md")
PACKAGES = (Path("sar_compiler"), Path("search_and_rescue"))
WORD_CEILINGS = {"pages": 3, "docstrings": 82, "messages": 15, "options": 0, "names": 6}
"""The number of texts with a word that the glossary does not use."""
MARK_CEILINGS = {"pages": 2.0, "docstrings": 2.2, "messages": 1.6}
"""The percentage of marked sentences. ruff, Nav2 and py_trees have 1 %, trio has 3 %."""
MARKS = re.compile(
    r"\b(nobody|somebody|whoever|whom|anybody|everybody)\b"
    r"|(^|[ (])[Ww]hat (is|are|was|has|have|it|a|an|the|they|comes|can|must|holds|counts|leaves|follows|ticks|others)\b"
    r"|\bwhere (it|that|there|they|the|a|an|no|one|this)\b"
    r"|\bof (one's|your|its|their|my|the project's|a user's|users') own\b|\bof (yours|theirs)\b"
    r"|\b(is|are|was|were) to be\b|\b(comes?|came) (to|of)\b|\bgo(es)? on\b|\bgoing on\b"
    r"|\b(anew|for ever|likewise|besides|but for|herewith|thereof|therein)\b"
    r"|\b(stands?|stood|lies|leads) (in|beside|behind|before|for|there|at|on|below|with|among)\b"
    r"|\bcounts?\b(?! (of|how|the|down|up|as))|\b(is|are|was|were|be) told\b|\btells of\b|\btold of\b"
    r"|\b(heeds?|owes?|owed|deed|a word (of|on)|put aside|in hand|begun)\b"
    r"|\b(behind|before) (it|that|the|them|this|all)\b|\b(is otherwise|was otherwise|is usual|as usual)\b"
)
_SENTENCE_END = re.compile(r"(?<=[.!?:;])\s+(?=[A-Z`\[*'‘“0-9])")  # noqa: RUF001 - quotation marks
_ITEM = re.compile(r"\s*([-*]|\d+\.) ")
_WORD_START = re.compile(r"_|(?<=[a-z])(?=[A-Z])")
_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
Text = tuple[str, str]
"""A location, `file:line`, and the text there."""


def page_texts(page: Path) -> Iterator[Text]:
    """Yield the sentences of a page: of its paragraphs, list items and table cells."""
    paragraph, start, last = list[str](), 0, 0
    for number, line in (*prose(page), (sys.maxsize, "")):
        is_apart = not line.strip() or line.startswith(("#", "|"))
        if is_apart or number != last + 1 or _ITEM.match(line):
            yield from ((f"{page}:{start}", each) for each in _sentences(" ".join(paragraph)))
            paragraph = []
        last = number
        if line.startswith("|"):
            cells = re.split(r"(?<!\\)\|", line)[1:-1]
            yield from ((f"{page}:{number}", each) for cell in cells for each in _sentences(cell))
        elif not is_apart:
            start = start if paragraph else number
            paragraph.append(_ITEM.sub("", line, count=1).strip())


def _sentences(text: str) -> list[str]:
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text).replace("**", "")
    return [each.strip() for each in _SENTENCE_END.split(text) if len(each.split()) >= 3]


def code_texts(path: Path) -> Iterator[tuple[str, Text]]:
    """Yield the texts of a module, each with its kind: first paragraphs of docstrings, messages, options and public names."""
    nodes = [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))]
    docstrings = set[ast.AST]()
    for node in nodes:
        if isinstance(node, _DOCUMENTED) and (text := ast.get_docstring(node, clean=False)) is not None:
            docstrings.add(node.body[0].value)  # type: ignore[attr-defined]
            first = " ".join(text.strip().split("\n\n")[0].split())
            yield "docstrings", (f"{path}:{getattr(node, 'lineno', 1)}", first)
    for node in nodes:
        place = f"{path}:{getattr(node, 'lineno', 1)}"
        if isinstance(node, _DOCUMENTED[1:]) and not node.name.startswith("_"):
            yield "names", (place, _WORD_START.sub(" ", node.name))
        elif isinstance(node, ast.JoinedStr | ast.Constant) and node not in docstrings:
            text = _text(node)
            if re.fullmatch(r"--[a-z0-9-]+", text):
                yield "options", (place, text[2:].replace("-", " "))
            elif len(text.split()) >= 5:
                yield "messages", (place, " ".join(text.split()))


def _text(node: "ast.JoinedStr | ast.Constant") -> str:
    """Return a string of the code, with `{…}` for each inserted value; empty for a constant that is not a string."""
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(each) if isinstance(each, ast.Constant) else "{…}" for each in node.values)
    return node.value if isinstance(node.value, str) else ""


def collect_texts() -> dict[str, list[Text]]:
    """Return all texts of the project by their kinds."""
    found: dict[str, list[Text]] = {kind: [] for kind in WORD_CEILINGS}
    for page in (Path("README.md"), *sorted(Path("docs").rglob("*.md"))):
        found["pages"] += page_texts(page)
    for path in (each for package in PACKAGES for each in sorted(package.rglob("*.py"))):
        for kind, text in code_texts(path):
            found[kind].append(text)
    return found


def unused_words() -> "re.Pattern[str]":
    """Return a pattern of the words that the glossary does not use."""
    words = [word.strip() for _, _, cells in tables(GLOSSARY) for word in cells[2].split(",")]
    return re.compile(rf"\b({'|'.join(re.escape(word) for word in words if word)})\b", re.IGNORECASE)


def with_words(texts: list[Text]) -> list[Text]:
    """Return the texts with a word that the glossary does not use, except in the glossary itself and in code spans."""
    pattern = unused_words()
    return [
        (place, text)
        for place, text in texts
        if not place.startswith(f"{GLOSSARY}:") and pattern.search(re.sub(r"`[^`]*`", "`…`", text))
    ]


def with_marks(texts: list[Text]) -> list[Text]:
    """Return the texts with a mark of contorted English."""
    return [each for each in texts if MARKS.search(each[1])]


def excesses(texts: dict[str, list[Text]], shown: str = "") -> list[str]:
    """Return the kinds of texts that are above their ceilings, and print those of one kind."""
    above = list[str]()
    for kind, of_kind in texts.items():
        words, marked = with_words(of_kind), with_marks(of_kind)
        if len(words) > WORD_CEILINGS[kind]:
            above.append(
                f"{kind}: {len(words)} with words of the last column of {GLOSSARY}, ceiling {WORD_CEILINGS[kind]}"
            )
        share = 100 * len(marked) / max(1, len(of_kind))
        if share > MARK_CEILINGS.get(kind, 100):
            above.append(
                f"{kind}: {share:.2f} % with marks of contorted English, ceiling {MARK_CEILINGS[kind]}"
            )
        if kind == shown:
            lines = [f"{place}: {text}\n" for place, text in sorted({*words, *marked})]
            sys.stdout.writelines(
                [*lines, f"{len(words)} with words, {share:.2f} % of {len(of_kind)} with marks\n"]
            )
    return above


if __name__ == "__main__":
    sys.exit("\n".join(excesses(collect_texts(), *sys.argv[1:])) or None)
