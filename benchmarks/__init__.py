"""What the project costs, as ratios: each figure beside what it is compared with, in turns in one run.

`make bench` runs all of it, and rewrites the tables of `benchmarks/README.md`, which says more.
"""
