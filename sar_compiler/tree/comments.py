"""The text of a comment, without the marks and the indentation of its form."""

from collections.abc import Iterable, Sequence


def text_of_xml(data: str) -> str:
    """Return the text of a comment, given what is between `<!--` and `-->`."""
    first, *rest = data.split("\n")
    # The first line begins after the mark, so its indentation says nothing about the others'.
    return _without_blank_ends([first.strip(), *_dedented(rest)])


def text_of_yaml(lines: Sequence[str]) -> str:
    """Return the text of consecutive comment lines, given what follows the `#` of each."""
    return _without_blank_ends(_dedented([line.removeprefix(" ") for line in lines]))


def _dedented(lines: Iterable[str]) -> list[str]:
    expanded = [line.expandtabs().rstrip() for line in lines]
    margin = min((len(line) - len(line.lstrip(" ")) for line in expanded if line), default=0)
    return [line[margin:] for line in expanded]


def _without_blank_ends(lines: Sequence[str]) -> str:
    return "\n".join(lines).strip("\n")
