"""The colours and signs in all output: pages, reports, drawings of trees, map exports and terminals.

The colours are those of Okabe and Ito, which colour-blind people can distinguish. No information is given by
colour alone.
"""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple


class Colour(NamedTuple):
    """A colour in two variants, for light and for dark backgrounds, in CSS notation."""

    light: str
    dark: str

    def for_background(self, *, dark: bool) -> str:
        """Return the variant for a light or dark background, as `#rrggbb`."""
        return self.dark if dark else self.light


COLOURS: Mapping[str, Colour] = {
    # text and lines, and their backgrounds
    "ground": Colour("#ffffff", "#14171b"),
    "raised": Colour("#f3f4f6", "#1e2329"),
    "chosen": Colour("#dbe9f8", "#223a52"),
    "line": Colour("#c6cad1", "#3c444e"),
    "text": Colour("#16191d", "#e8eaed"),
    "quiet": Colour("#545d69", "#a8b1bc"),
    "mark": Colour("#0b57a4", "#7cc0f5"),
    # statuses and progress, with text in the colour `for_background` on top
    "running": Colour("#005f9e", "#5db7f0"),
    "success": Colour("#00694d", "#3fd0a4"),
    "failure": Colour("#b03a00", "#ff8b4d"),
    "halted": Colour("#5b6470", "#a2abb6"),
    "skipped": Colour("#8a3f6d", "#dd9bc2"),
    "none": Colour("#9aa2ad", "#66707c"),
    "on": Colour("#ffffff", "#10131a"),
    # warnings, errors, and obstacles for the robot
    "warning": Colour("#e69f00", "#f0b429"),
    "on-warning": Colour("#231800", "#1d1400"),
    "error": Colour("#b03a00", "#ff8b4d"),
    "on-error": Colour("#ffffff", "#1c0d03"),
    "stop": Colour("#a83200", "#a83200"),
    "on-stop": Colour("#ffffff", "#ffffff"),
    # the map
    "robot": Colour("#8a3f8a", "#e6a3e6"),
    "trail": Colour("#0072b2", "#5db7f0"),
    "plan": Colour("#b03a00", "#ff8b4d"),
    "likely": Colour("#cc79a7", "#dd9bc2"),
    "seen": Colour("#009e73", "#3fd0a4"),
    "grid": Colour("rgb(20 30 45 / .09)", "rgb(220 230 245 / .1)"),
    # the shapes of a tree's nodes: as in py_trees' drawings, but lighter
    "sequence": Colour("#ffd9a0", "#6b4408"),
    "selector": Colour("#b5eff4", "#0d565e"),
    "parallel": Colour("#ffec99", "#655300"),
    "control": Colour("#ece6b0", "#54501f"),
    "decorator": Colour("#f2f2fa", "#2b2d3d"),
    "leaf": Colour("#e4e6e9", "#33373d"),
}


class LevelStyle(NamedTuple):
    """The style for the progress of a landmark, or for the verdict on a property.

    Attributes:
        word: The CSS class of the marks.
        colour: The name of the colour in `COLOURS`.
        sign: The sign in a mark, or before the word for the verdict.
    """

    word: str
    colour: str
    sign: str


LEVELS = (
    LevelStyle("to-come", "quiet", ""),
    LevelStyle("in-hand", "running", "▶"),
    LevelStyle("done", "success", "✓"),
    LevelStyle("given-up", "failure", "✗"),
)
"""The style for each `Level`. The number of a level is its index."""
FOUND = LevelStyle("found", "warning", "!")
"""The style for a detection. The sign is shown until a person has visited the location."""
_DONE, _GIVEN_UP = 2, 3

MARKS: Mapping[str, str] = {
    "circle": "M0 -11 A11 11 0 1 1 -0.01 -11 Z",
    "triangle": "M0 -12 L12 9 H-12 Z",
    "house": "M-10 10 V-2 L0 -11 L10 -2 V10 Z",
    "square": "M-9 -9 H9 V9 H-9 Z",
}
"""The outline of each landmark shape, as an SVG path 24 units wide around the origin. The default is a circle."""

# The letter of each status, and the outline of its mark, as an SVG path in a square of 16 units.
_STATUSES = {
    "RUNNING": ("R", "M0.5 1.5 H10 L16 8 L10 14.5 H0.5 Z"),
    "SUCCESS": ("S", "M8 1 A7 7 0 1 1 7.99 1 Z"),
    "FAILURE": ("F", "M1.5 1.5 H14.5 V14.5 H1.5 Z"),
    "HALTED": ("H", "M5 1 H11 L15 5 V11 L11 15 H5 L1 11 V5 Z"),
    "SKIPPED": ("\u2013", "M8 0.5 L15.5 8 L8 15.5 L0.5 8 Z"),
    "": ("", "M8 4 A4 4 0 1 1 7.99 4 Z"),
}
CONDITIONS = {"good": "●", "quiet": "○", "warning": "▲", "error": "■"}
"""The signs for conditions and alarms, by severity."""
PROPERTIES = {
    "watched": LevelStyle("watched", "quiet", "○"),
    "owed": LevelStyle("owed", "running", "…"),
    "kept": LevelStyle("kept", "success", "✓"),
    "broken": LevelStyle("broken", "failure", "✗"),
}
"""The styles for monitored properties, by verdict."""
DECORATORS = {"↻": "runs its child again", "▣": "subtree", "◇": "another decorator"}
"""The meanings of the signs on decorators. All decorators have the same shape."""
IN_TEXT = {"RUNNING": "[*]", "SUCCESS": "[✓]", "FAILURE": "[✕]", "SKIPPED": "[>]", "": "[-]"}
"""The status signs in text output, as in py_trees."""

TERMINAL: Mapping[str, str] = {
    "RUNNING": "bold cyan",
    "SUCCESS": "green",
    "FAILURE": "bold red",
    "SKIPPED": "dim",
    "title": "bold reverse",
    "quiet": "dim",
    "alarm": "bold red",
    "place": "bold",
    "error": "bold red",
    "warning": "bold yellow",
    "info": "bold cyan",
    "margin": "dim",
    "carets": "bold red",
    "advice": "green",
}
"""The styles of text in a terminal, in the notation of rich. The terminal defines the actual colours."""

TAK_CERTAIN, TAK_LIKELY = -65536, -35072
"""The colours for confirmed (red) and unconfirmed (orange) detections in TAK, as signed ARGB numbers."""


def colour_of(level: int, *, is_found: bool) -> str:
    """Return the colour name for a landmark that is drawn in a single colour.

    Args:
        level: The landmark's progress, a `Level`.
        is_found: Whether robots detect landmarks of this kind.
    """
    if not is_found:
        return LEVELS[level].colour
    return LEVELS[0].colour if level == _GIVEN_UP else FOUND.colour


def sign_of(level: int, *, is_found: bool) -> str:
    """Return the sign that is drawn inside the mark of a landmark."""
    return FOUND.sign if is_found and level < _DONE else LEVELS[level].sign


def rgb(name: str, *, dark: bool = False) -> tuple[float, float, float]:
    """Return the red, green and blue components of a colour. Each is from 0 to 1."""
    red, green, blue = (
        int(part, 16) / 255 for part in re.findall("[0-9a-f]{2}", COLOURS[name].for_background(dark=dark))
    )
    return red, green, blue


def style() -> str:
    """Return the stylesheet of pages and reports. It defines the named colours and the marks on a map."""
    light, dark = (
        ";".join(f"--{name}:{each.for_background(dark=dark)}" for name, each in COLOURS.items())
        for dark in (False, True)
    )
    looks = (*LEVELS, FOUND, *PROPERTIES.values())
    levels = "".join(f".{each.word}{{--level:var(--{each.colour})}}" for each in looks)
    # Pages are printed in light colours.
    return (
        f":root{{color-scheme:light dark;{light};--map:none}}\n"
        f"@media screen and (prefers-color-scheme:dark){{:root{{{dark};--map:invert(.88)}}}}\n"
        f"{levels}\n{Path(__file__).with_name('marks.css').read_text('utf-8')}"
    )


def literal(css: str) -> str:
    """Replace the colour names in a stylesheet by literal colours, for renderers without `var()`."""
    coloured = "\n".join(line for line in css.splitlines() if "var(" in line)
    light, dark = _resolve(css, dark=False), _resolve(coloured, dark=True)
    return f"{light}@media (prefers-color-scheme:dark){{\n{dark}\n}}\n"


def _resolve(css: str, *, dark: bool) -> str:
    return re.sub(r"var\(--([a-z-]+)\)", lambda name: COLOURS[name[1]].for_background(dark=dark), css)


def script() -> str:
    """Return a JavaScript module that contains the signs for the pages."""
    told = {
        "LEVELS": [each._asdict() for each in LEVELS],
        "FOUND": FOUND._asdict(),
        "MARKS": MARKS,
        "STATUSES": _STATUSES,
        "CONDITIONS": CONDITIONS,
        "PROPERTIES": {name: each._asdict() for name, each in PROPERTIES.items()},
        "DECORATORS": DECORATORS,
    }
    return "".join(
        f"export const {name} = {json.dumps(each, ensure_ascii=False)};\n" for name, each in told.items()
    )
