"""Draw the badges of the README: `python docs/pictures/badges.py` in the project's folder writes `badges.svg`.

They state what the project's files say, and need no account and no network.
"""

import re
from pathlib import Path

from sar_compiler.style import COLOURS

ROOT = Path(__file__).parents[2]
HEIGHT, CHARACTER, PADDING, GAP = 20, 6.6, 7, 6
"""Pixels: of a badge, of a character at 11 px, beside a text, and between two badges."""


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


def picture() -> str:
    """Return all badges as one picture."""
    parts, left = list[str](), 0.0
    for label, value in badges():
        for text, fill, colour in ((label, "halted", "on"), (value, "success", "on")):
            width = len(text) * CHARACTER + 2 * PADDING
            parts.append(
                f'<rect x="{left:.1f}" width="{width:.1f}" height="{HEIGHT}" fill="{COLOURS[fill].light}"/>'
            )
            parts.append(
                f'<text x="{left + width / 2:.1f}" y="14" textLength="{len(text) * CHARACTER:.1f}" '
                f'fill="{COLOURS[colour].light}">{text}</text>'
            )
            left += width
        left += GAP
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left - GAP:.0f}" height="{HEIGHT}">\n'
        "<!-- Made by docs/pictures/badges.py; do not edit. -->\n"
        f'<g font-family="Verdana,sans-serif" font-size="11" text-anchor="middle">\n{chr(10).join(parts)}\n</g>\n</svg>\n'
    )


if __name__ == "__main__":
    Path(__file__).with_suffix(".svg").write_text(picture(), encoding="utf-8")
