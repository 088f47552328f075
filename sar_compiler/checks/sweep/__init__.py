"""Many random runs: how often a mission succeeds, for each combination of what is varied."""
