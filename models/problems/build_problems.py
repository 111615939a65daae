"""Writes the planning problems beside this file: `python models/problems/build_problems.py`, about half a minute.

Forty of every kind, from seed 0. Rows: one problem each; format: docs/formats.md; what is drawn: bench/plan_sets.py.
"""

from pathlib import Path

from sum_drake.bench.plan_sets import write_sets

COUNT, SEED = 40, 0

if __name__ == "__main__":
    write_sets(Path(__file__).parent, count=COUNT, seed=SEED, progress=print)
