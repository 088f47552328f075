"""Check the files of one command, with cached results, worker processes and fixes.

`Validation` runs the check; `sar-compile validate` parses the options and prints the findings.
"""

PUBLIC_MODULES = ("check_cache", "validation")
"""The modules that other parts may import."""
