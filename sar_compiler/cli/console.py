"""Entry points of the console scripts."""

import sys
from functools import partial

from sar_compiler.console_command import console_command

_CLI = "sar_compiler.cli"
sar_compile = partial(console_command, f"{_CLI}.compile")
sar_run = partial(console_command, f"{_CLI}.run", "command")
sar_run_repeatedly = partial(console_command, f"{_CLI}.repeated_runs", "serve")
sar_sim = partial(console_command, f"{_CLI}.sim", is_server=sys.argv[1:2] == ["run"])
sar_journal = partial(console_command, f"{_CLI}.journal_command")
