"""Entry points of the console scripts `sar-detect-survivor-server` and `sar-report-survivor-server`."""

from functools import partial

from sar_compiler.missions import console_command

_COMMANDS = "search_and_rescue.server_commands"
sar_detect_survivor_server = partial(console_command, _COMMANDS, "detect", is_server=True)
sar_report_survivor_server = partial(console_command, _COMMANDS, "report", is_server=True)
