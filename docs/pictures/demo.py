"""Draw the animated picture of the README: `python docs/pictures/demo.py` in the project's folder, with ROS 2, writes `demo.svg`.

In ten seconds the picture shows a finding about a typo, a counterexample, and a run. The lines are the outputs of the commands for the tree of
the README. The map comes from `mission.svg`, which `mission.py` draws.
"""

import re
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path
from xml.sax.saxutils import escape

from sar_compiler.style import COLOURS

FOLDER = Path(__file__).parent
PICTURE = FOLDER / "demo.svg"
README = FOLDER.parents[1] / "README.md"
SEC = 10
"""The duration of the animation, seconds."""
COLUMNS, LINE, LEFT, TOP = 60, 20, 10, 58
"""The number of characters in a line, and the height of a line, the left edge and the first base line in pixels."""
WIDTH, HEIGHT = 560, 366


def run_command(command: str, tree: str) -> list[str]:
    """Run a command in a folder with `patrol.xml`, and return the lines that it prints."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "patrol.xml").write_text(tree, encoding="utf-8")
        program, *arguments = command.split()
        done = subprocess.run(  # noqa: S603 - our own command
            [Path(sys.executable).with_name(program), *arguments],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
    return done.stdout.splitlines()


def tree_of_readme() -> str:
    """Return the tree file that the README shows."""
    text = README.read_text(encoding="utf-8")
    [found] = re.findall(r"^`patrol\.xml`.*:\n\n```xml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return str(found)


def checked(tree: str) -> tuple[list[str], list[str]]:
    """Return the output of `validate` for the tree with its typo, and that of `verify` for the corrected tree."""
    typo = run_command("sar-compile validate patrol.xml", tree)
    return typo, run_command("sar-compile verify patrol.xml", tree.replace("Succesful", "Successful"))


def wrap_lines(lines: list[str]) -> list[str]:
    """Break lines that are longer than `COLUMNS` between words; a quoted line of a file is cut instead."""
    shown = list[str]()
    for line in lines:
        if re.match(r" +\d+ \|", line):
            shown.append(line if len(line) <= COLUMNS else f"{line[: COLUMNS - 1]}…")
        else:
            indent = " " * (len(line) - len(line.lstrip(" |")))
            shown += textwrap.wrap(line, COLUMNS, subsequent_indent=indent, drop_whitespace=False)
    return shown


def text(lines: list[str], first: int, colour: str, left: int = LEFT) -> str:
    """Return the SVG of lines of text that start at a line of the picture."""
    return "".join(
        f'<text class="code" x="{left}" y="{TOP + LINE * number}" fill="{COLOURS[colour].dark}">{escape(line)}</text>\n'
        for number, line in enumerate(lines, first)
    )


def scene(number: int, title: str, command: str, shown: str) -> str:
    """Return the SVG of a scene: its title and command, and the output, which appears half a second later."""
    return f"""\
<g class="scene{number}">
<text class="title" x="{LEFT}" y="26" fill="{COLOURS["mark"].dark}">{title}</text>
{text([f"$ {command}"], 0, "text")}<g class="output{number}">
{shown}</g>
</g>
"""


def timing() -> str:
    """Return the stylesheet that shows each scene for a third of the time, or only the first scene if motion is reduced."""
    rules = []
    for number in range(3):
        begin, end = 100 * number / 3, 100 * (number + 1) / 3
        for name, start in (("scene", begin), ("output", begin + 6)):
            hidden = "" if start == 0 else "0%{opacity:0}"
            rules.append(
                f"@keyframes {name}{number}{{{hidden}{start:.1f}%{{opacity:1}}{end:.1f}%{{opacity:0}}}}"
            )
            rules.append(f".{name}{number}{{animation:{name}{number} {SEC}s step-end infinite}}")
    still = "[class^=scene],[class^=output]{animation:none}.scene1,.scene2{opacity:0}"
    return "\n".join([*rules, f"@media (prefers-reduced-motion:reduce){{{still}}}"])


def map_in_last_third() -> str:
    """Return the map of the mission, on which the robot drives in the last third of the time."""
    drawn = (FOLDER / "mission.svg").read_text(encoding="utf-8")
    drawn = drawn.replace('width="630" height="530"', f'x="{LEFT}" y="{TOP + 14}" width="336" height="283"')
    drawn = re.sub(r"<!--.*?-->\n", "", drawn)
    [times], [values] = (re.findall(rf'{name}="([^"]*)"', drawn) for name in ("keyTimes", "values"))
    late = ";".join(f"{0.70 + 0.27 * float(each):.4f}" for each in times.split(";"))
    first, last = values.split(";")[0], values.split(";")[-1]
    drawn = drawn.replace(times, f"0;{late};1").replace(values, f"{first};{values};{last}")
    return re.sub(r'dur="[^"]*"', f'dur="{SEC}s"', drawn)


def picture(typo: list[str], proof: list[str], run: list[str]) -> str:
    """Return the picture, given the outputs of the three commands."""
    shown = wrap_lines(typo)
    last = len(proof) - proof[::-1].index("every run ends: does not hold") - 1
    answers = [line for line in proof if re.match(r"  (home .*|every run ends): ", line)]
    figures = [
        re.sub(r": +", ": ", line.strip()).partition(" (")[0]
        for line in run
        if re.match(r"  (zones|back|duration)", line)
    ]
    figures.insert(
        1, f"survivors found: {', '.join(dict.fromkeys(re.findall(r'survivor_[0-9]+', ' '.join(run))))}"
    )
    scenes = [
        scene(0, "1. Check: a typo", "sar-compile validate patrol.xml", text(shown, 2, "failure")),
        scene(
            1,
            "2. Verify: a run that never ends",
            "sar-compile verify patrol.xml",
            text(wrap_lines(answers), 2, "success") + text(wrap_lines(proof[last:]), 6, "failure"),
        ),
        scene(
            2,
            "3. Run: a mission in the simulator",
            "sar-run --sim",
            map_in_last_third()
            + text([part for each in figures for part in textwrap.wrap(each, 22)], 2, "text", 356),
        ),
    ]
    return f"""\
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}">
<!-- Made by docs/pictures/demo.py; do not edit. -->
<style>
.code{{font:15px ui-monospace,"DejaVu Sans Mono",Menlo,Consolas,monospace;white-space:pre}}
.title{{font:bold 17px sans-serif}}
{timing()}
</style>
<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="{COLOURS["ground"].dark}"/>
{"".join(scenes)}</svg>
"""


def main() -> None:
    """Run the commands with the tree of the README, and draw the picture."""
    tree = tree_of_readme()
    run = run_command("sar-run --sim --speed 20 --journal none", tree)
    PICTURE.write_text(picture(*checked(tree), run), encoding="utf-8")


if __name__ == "__main__":
    main()
