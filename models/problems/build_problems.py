"""Writes the planning problems beside this file: `python models/problems/build_problems.py`, about ten minutes.

Forty of every kind for `bench plan`'s hard sets (what is drawn: bench/plan_sets.py; format: docs/formats.md), and in
table.json the paths that picks from 112 poured tables ask for (bench/plan_queries.py). All from seed 0, one a line.
"""

from pathlib import Path

from sum_drake.bench.plan_queries import make_queries, write_queries
from sum_drake.bench.plan_sets import write_sets
from sum_drake.objects import load_catalogue

COUNT, POURS, SEED = 40, 112, 0

if __name__ == "__main__":
    write_sets(Path(__file__).parent, count=COUNT, seed=SEED, progress=print)
    write_queries(Path(__file__).parent / "table.json", make_queries(load_catalogue(), pours=POURS, seed=SEED))
