"""The checks and fixes of `sar-compile validate`, with cached results and worker processes.

`Validation` checks the files. The command parses the options and prints the findings.
"""

PUBLIC_MODULES = ("check_cache", "validation")
"""The modules that other parts may import."""
