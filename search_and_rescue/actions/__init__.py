"""The mission's actions: drive, search, publish, report."""
