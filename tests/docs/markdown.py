"""What the tests of the documentation read from a page: links, headings, tables, fenced blocks, commands."""

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
# The line above a fenced block that says which file it is: `rover/drive.py`: or: Save this leaf as `rover/drive.py`:
_NAMED = re.compile(r"(?:^|\b[Ss]ave (?:.* )?as )`([\w./-]+\.\w+)`.*:$")
_LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)")
# A row of a list of definitions: - **name**: what it is
_DEFINITION = re.compile(r"^- \*\*(.+?)\*\*: (.+)$")
_HEADING = re.compile(r"^(#+) (.*)$")
_SEPARATORS = {"&&", "||", "|", ";", "&"}


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes:
        language: What stands behind the fence.
        text: What is in it, with a line end.
        line: The line of its first line, from 1.
        file: The file that the page says it is; empty if it does not.
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
        line: The line of the block that it stands in.
        words: The program and its arguments.
        made: Files that the page has made by then, as it names them.
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
    return [(number, target) for number, line in prose(page) for target in _LINK.findall(_uncoded(line))]


def headings(page: Path) -> list[tuple[str, str]]:
    """Return the headings of a page, each behind what GitHub makes an anchor of."""
    found = [_HEADING.match(line) for _, line in prose(page)]
    return [(_slug(heading[2]), heading[2]) for heading in found if heading]


def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub makes of a page's headings."""
    made: dict[str, int] = {}
    for slug, _ in headings(page):
        made[slug] = made.get(slug, -1) + 1
    return {
        f"{slug}-{number}" if number else slug for slug, most in made.items() for number in range(most + 1)
    }


def tables(page: Path) -> list[tuple[str, int, list[str]]]:
    """Return the rows of a page's tables and lists of definitions, heads and rulers left out: heading above, line, cells."""
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
    """Return what stands between backticks, single or double, in a piece of text."""
    return [found[1].strip() for found in re.findall(r"(`+)(.+?)\1(?!`)", text)]


def commands(page: Path) -> list[ShellCommand]:
    """Return the commands in the `sh` blocks of a page, and those after a prompt in its `console` blocks."""
    found: list[ShellCommand] = []
    # Lessons, whose names begin with their numbers, are followed one after the other.
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
    """Take a shell line apart: the words of each command, and the files that it writes."""
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


def _uncoded(line: str) -> str:
    return re.sub(r"(?<!`)(`+)(?!`).+?(?<!`)\1(?!`)", "", line)


def _slug(heading: str) -> str:
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")
