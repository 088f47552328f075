"""Parses documentation pages for the tests: links, headings, tables, fenced blocks, commands."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

PAGES = sorted(
    [
        Path("README.md"),
        Path("CONTRIBUTING.md"),
        Path("QUALITY_DECLARATION.md"),
        Path("SECURITY.md"),
        *(page for page in Path("docs").rglob("*.md") if page.parent.name != "findings"),
        *Path("examples").rglob("README.md"),
    ]
)

_FENCE = re.compile(r"^\s*```(\w*)\s*$")
# The line above a fenced block that names its file: `rover/drive.py`: or: Save this leaf as `rover/drive.py`:
_NAMED = re.compile(r"(?:^|\b[Ss]ave (?:.* )?as )`([\w./-]+\.\w+)`.*:$")
_LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)")
# An item of a definition list: - **name**: description
_DEFINITION = re.compile(r"^- \*\*(.+?)\*\*: (.+)$")
_HEADING = re.compile(r"^(#+) (.*)$")
_SEPARATORS = {"&&", "||", "|", ";", "&"}


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes:
        language: The language after the opening fence.
        text: The content, with a final line end.
        line: The number of the first line of the content, from 1.
        file: The file name that the page gives the block; empty if there is none.
    """

    language: str
    text: str
    line: int
    file: str


@dataclass(frozen=True)
class ShellCommand:
    """One command of a page.

    Attributes:
        page: The page.
        line: The first line of its block.
        words: The program and its arguments.
        made: The files that the page has created before, as it names them.
    """

    page: Path
    line: int
    words: tuple[str, ...]
    made: frozenset[str]

    def __str__(self) -> str:
        return f"{self.page}:{self.line} {' '.join(self.words)}"


def blocks(page: Path) -> list[Block]:
    """Return the fenced blocks of a page."""
    found: list[Block] = []
    before, language, start = "", None, 0
    lines = page.read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines, 1):
        fence = _FENCE.match(line)
        if fence is None:
            before = line.strip() if language is None and line.strip() else before
        elif language is None:
            language, start = fence[1], number + 1
        else:
            named = _NAMED.search(before)
            text = "".join(f"{each}\n" for each in lines[start - 1 : number - 1])
            found.append(Block(language, text, start, named[1] if named else ""))
            before, language = "", None
    assert language is None, f"{page}: the block that begins in line {start} has no end"
    return found


def prose(page: Path) -> list[tuple[int, str]]:
    """Return the lines outside of fenced blocks, with their numbers."""
    inside = {
        number
        for block in blocks(page)
        for number in range(block.line - 1, block.line + block.text.count("\n") + 1)
    }
    lines = enumerate(page.read_text(encoding="utf-8").splitlines(), 1)
    return [(number, line) for number, line in lines if number not in inside]


def links(page: Path) -> list[tuple[int, str]]:
    """Return the targets of a page's links, with their lines."""
    return [(number, target) for number, line in prose(page) for target in _LINK.findall(_without_code(line))]


def headings(page: Path) -> list[tuple[str, str]]:
    """Return the headings of a page as pairs of slug and text. GitHub makes the anchor from the slug."""
    found = [_HEADING.match(line) for _, line in prose(page)]
    return [(_slug(heading[2]), heading[2]) for heading in found if heading]


def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub makes from a page's headings."""
    made: dict[str, int] = {}
    for slug, _ in headings(page):
        made[slug] = made.get(slug, -1) + 1
    return {
        f"{slug}-{number}" if number else slug for slug, most in made.items() for number in range(most + 1)
    }


def tables(page: Path) -> list[tuple[str, int, list[str]]]:
    """Return the rows of a page's tables and definition lists without header rows: heading above, line, cells."""
    rows: list[tuple[str, int, list[str]]] = []
    heading, head_passed = "", False
    for number, line in prose(page):
        found = _HEADING.match(line)
        heading = found[2] if found else heading
        if defined := _DEFINITION.match(line):
            rows.append((heading, number, [*defined.groups()]))
        if not line.startswith("|"):
            head_passed = False
        elif re.fullmatch(r"[|\s:-]+", line):
            head_passed = True
        elif head_passed:
            cells = re.split(r"(?<!\\)\|", line.strip().strip("|"))
            rows.append((heading, number, [cell.strip().replace("\\|", "|") for cell in cells]))
    return rows


def codes(text: str) -> list[str]:
    """Return the code spans of a text, between single or double backticks."""
    return [found[1].strip() for found in re.findall(r"(`+)(.+?)\1(?!`)", text)]


def commands(page: Path) -> list[ShellCommand]:
    """Return the commands in the `sh` blocks of a page, and those after a prompt in its `console` blocks."""
    found: list[ShellCommand] = []
    # A reader follows numbered lessons in order, so a lesson can use the files of earlier lessons.
    lessons = page.parent.glob("[0-9]-*.md") if page.name[0].isdigit() else ()
    made = {block.file for each in lessons if each.name < page.name for block in blocks(each) if block.file}
    for block in blocks(page):
        if block.file:
            made.add(block.file)
        text = block.text if block.language == "sh" else ""
        if block.language == "console":
            text = "".join(f"{line}\n" for line in re.findall(r"^\$ (.*)$", block.text, re.MULTILINE))
        for line in text.replace("\\\n", " ").splitlines():
            for words, written in _simple_commands(line):
                made |= written
                found.append(ShellCommand(page, block.line, words, frozenset(made)))
    return found


def _simple_commands(line: str) -> list[tuple[tuple[str, ...], set[str]]]:
    """Split a shell line into commands: the words of each command, and the files that it writes."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars="&|;<>")
    lexer.whitespace_split = True
    found: list[tuple[tuple[str, ...], set[str]]] = []
    words: list[str] = []
    written: set[str] = set()
    for word in [*lexer, ";"]:
        if word in _SEPARATORS:
            if words:
                found.append((tuple(words), written))
            words, written = [], set()
        elif words and words[-1] == ">":
            words.pop()
            written.add(word)
        elif words or not (word == "sudo" or re.match(r"[A-Z_]+=", word)):
            words.append(word)
    return found


def _without_code(line: str) -> str:
    return re.sub(r"(?<!`)(`+)(?!`).+?(?<!`)\1(?!`)", "", line)


def _slug(heading: str) -> str:
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")
