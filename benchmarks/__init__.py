"""The project's cost in time and memory to its users: a table of goals, measured by `make bench`; see `benchmarks/README.md`."""
