"""The check of the files of one command: by kept results, in copies of the process, and with fixes.

`Validation` is its application; `sar-compile validate` parses its options and prints its findings.
"""

PUBLIC_MODULES = ("check_cache", "validation")
"""The modules that other parts may import."""
