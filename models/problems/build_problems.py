"""Writes the planning problems beside this file: `python models/problems/build_problems.py`, about ten minutes.

Forty of every kind for `bench plan`'s hard sets (what is drawn: bench/plan_sets.py; format: docs/formats.md), and in
table.json the paths that picks from 112 poured tables ask for (bench/plan_queries.py), one a line. What is committed is
of seed 0; with --seed and --out, other ones, that nothing was ever tuned on.
"""

import argparse
from pathlib import Path

from sum_drake.bench.plan_queries import make_queries, write_queries
from sum_drake.bench.plan_sets import KINDS, write_sets
from sum_drake.objects import load_catalogue

COUNT, POURS = 40, 112


def main() -> None:
    """Writes what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    parser.add_argument("--kinds", nargs="+", choices=[*KINDS, "table"], default=[*KINDS, "table"])
    options = parser.parse_args()
    kinds = [kind for kind in options.kinds if kind in KINDS]
    write_sets(options.out, count=COUNT, seed=options.seed, kinds=kinds, progress=print)
    if "table" in options.kinds:
        queries = make_queries(load_catalogue(), pours=POURS, seed=options.seed)
        write_queries(options.out / "table.json", queries)


if __name__ == "__main__":
    main()
