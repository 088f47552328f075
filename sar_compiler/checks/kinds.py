"""All kinds of findings: their codes, default severities and summaries.

The table in `docs/findings/README.md` lists them. Each has a page beside it, which `sar-compile explain` shows.
"""

import re
from dataclasses import dataclass

from sar_compiler.resources import shipped
from sar_compiler.tree.diagnostic import Severity


@dataclass(frozen=True)
class FindingKind:
    """A kind of finding.

    Attributes:
        code: Its name, in kebab-case words.
        severity: How bad it is by default.
        summary: What it says, in half a sentence.
    """

    code: str
    severity: Severity
    summary: str


_ROW = re.compile(r"^\| \[`([\w-]+)`\]\(\1\.md\) \| (\w+) \| (.+?) \| [^|]+ \|$", re.MULTILINE)

KINDS = {
    code: FindingKind(code, Severity(severity), summary)
    for code, severity, summary in _ROW.findall(shipped("docs/findings", "README.md").read_text("utf-8"))
}
"""All kinds, by their code."""


def page_of(code: str) -> str:
    """Return the page about a kind of finding, in Markdown.

    Raises:
        ResourceError: If it is not installed.
    """
    return shipped("docs/findings", f"{code}.md").read_text("utf-8")


def is_firm(code: str) -> bool:
    """Return whether a kind is an error by default; such a tree cannot be run, so no setting changes it."""
    kind = KINDS.get(code)
    return kind is not None and kind.severity is Severity.ERROR
