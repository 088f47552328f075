"""The page about sweeps does what it says, and leaves nothing out."""

import argparse
from pathlib import Path

from sar_compiler.cli.sim_sweep import add_sim_sweep
from sar_compiler.cli.sweep import add_sweep
from tests.docs.markdown import codes, tables
from tests.docs.test_tables_and_drawings import options_of
from tests.docs.test_worked_pages import follow

PAGE = Path("docs/sweep.md").resolve()


def test_the_page_about_sweeps_does_what_it_says(tmp_path):
    typed, otherwise = follow(PAGE, tmp_path)
    assert typed == 2
    assert otherwise == [], "\n".join(otherwise)


def test_every_option_of_both_commands_is_explained():
    shown = {code.split()[0] for _, _, cells in tables(PAGE) for code in codes(cells[0])}
    text = PAGE.read_text(encoding="utf-8")
    for add in (add_sweep, add_sim_sweep):
        command = argparse.ArgumentParser()
        add(command)
        missing = {each for each in options_of(command) if each not in shown and f"`{each}" not in text}
        assert missing - {"--model"} == set()
