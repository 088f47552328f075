"""What the project costs where users wait or pay: one table of goals, measured by `make bench`; `benchmarks/README.md` states more."""
