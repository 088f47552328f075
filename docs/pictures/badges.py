"""Draw the badges of the README: `python docs/pictures/badges.py` in the project's folder writes `badge_….svg`.

The badges show values from the project's files, without an account or a network.
"""

import re
from pathlib import Path

from sar_compiler.style import COLOURS

ROOT = Path(__file__).parents[2]
HEIGHT, CHARACTER, PADDING = 20, 6.6, 7
"""The height of a badge, the width of a character at 11 px, and the padding beside a label, in pixels."""


def badges() -> list[tuple[str, str]]:
    """Return the label and the value of each badge."""
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    [licence] = re.findall(r'^license = \{ text = "(.+)" \}', project, re.MULTILINE)
    [version] = re.findall(r'^version = "(.+)"', project, re.MULTILINE)
    [pythons] = re.findall(
        r"^RELEASED \?= (.+)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE
    )
    first, *_, last = pythons.split()
    is_released = 'value = ""' not in (ROOT / "release/publication.toml").read_text(encoding="utf-8")
    return [
        ("licence", licence),
        ("Python", f"{first} to {last}"),
        ("ROS 2", "Jazzy"),
        ("checks", "without ROS"),
        ("version", version if is_released else f"{version}, not released"),
    ]


def pictures() -> dict[Path, str]:
    """Return the SVG of each badge by its path; with separate files, narrow screens can show several rows."""
    return {
        Path(__file__).with_name(f"badge_{label.split()[0].lower()}.svg"): _picture(label, value)
        for label, value in badges()
    }


def _picture(label: str, value: str) -> str:
    parts, left = list[str](), 0.0
    for text, fill in ((label, "halted"), (value, "success")):
        length = len(text) * CHARACTER
        width = length + 2 * PADDING
        parts.append(
            f'<rect x="{left:.1f}" width="{width:.1f}" height="{HEIGHT}" fill="{COLOURS[fill].light}"/>'
        )
        parts.append(f'<text x="{left + width / 2:.1f}" y="14" textLength="{length:.1f}">{text}</text>')
        left += width
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left:.0f}" height="{HEIGHT}">\n'
        "<!-- Made by docs/pictures/badges.py; do not edit. -->\n"
        f'<g font-family="Verdana,sans-serif" font-size="11" text-anchor="middle" fill="{COLOURS["on"].light}">\n'
        f"{chr(10).join(parts)}\n</g>\n</svg>\n"
    )


if __name__ == "__main__":
    for path, drawn in pictures().items():
        path.write_text(drawn, encoding="utf-8")
