"""Learns what earlier looks are worth, and what it says that nothing was detected: `existence.AGREED` and `MISSED`.

    python benchmarks/recursion_fit.py

Tables (`sum_drake/bench/sequences.py`; seeds from 310, those of the bench begin at 1000) are looked at three times,
and something happens to each after the first. Of every track that was detected again where it was believed to be, and
of every one that was not detected, it is known what was believed before, what the look says, and whether it is right.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from scipy.optimize import minimize_scalar

from sum_drake import existence
from sum_drake.bench.hypotheses import Judged
from sum_drake.bench.pose_scenes import other_meshes
from sum_drake.bench.results import made_with
from sum_drake.bench.sequences import FAULTS, Followed, run_sequence
from sum_drake.bench.watching import Tables, setting
from sum_drake.detection.inference import load_detector
from sum_drake.existence import agreed_probability, missed_probability
from sum_drake.files import write_whole
from sum_drake.filter_config import filter_config
from sum_drake.jsonio import decode, encode
from sum_drake.objects import load_catalogue
from sum_drake.presence import Presence
from sum_drake.types import Array

RESULT = Path(__file__).parent / "results" / "recursion_fit.json"
FIRST = 310


def gather(tables: int, rows: Path) -> list[Judged]:
    """Every hypothesis after every look; kept in a file as they come, a line a table."""
    done = [json.loads(line) for line in rows.read_text().splitlines()] if rows.exists() else []
    catalogue = load_catalogue()
    detector = load_detector(None, labels=catalogue.labels)
    with tempfile.TemporaryDirectory() as folder:
        looks = Tables(catalogue, other_meshes(catalogue, Path(folder), 0), detector, filter_config())
        for seed in range(FIRST + len(done), FIRST + tables):
            followed = run_sequence(looks, setting(seed), list(FAULTS)[seed % len(FAULTS)])
            done.append(encode(followed))
            with rows.open("a") as file:
                file.write(json.dumps(done[-1]) + "\n")
            print(f"table {len(done)} of {tables}", file=sys.stderr, flush=True)
    return [one for data in done[:tables] if data is not None for one in decode(Followed, data).judged]


def looked_at(features: dict[str, float]) -> Presence:
    """What was seen where a track was that was not detected."""
    return Presence(*(features[f"look_{name}"] for name in ("pixels", "explained", "free", "hidden")))


def learned(constant: str, told: Callable[[], Array], right: Array) -> dict[str, float]:
    """The value of a constant of `existence` under which what was so is likeliest, and what it is worth."""

    def loss(value: float) -> float:
        setattr(existence, constant, value)
        p = np.clip(told(), 1e-6, 1 - 1e-6)
        return float(-np.mean(np.where(right, np.log(p), np.log(1 - p))))

    committed = getattr(existence, constant)
    try:
        found = minimize_scalar(loss, bounds=(0.0, 4.0), method="bounded")
        return {
            "tracks": len(right),
            "right": float(right.mean()),
            "learned": round(float(found.x), 2),
            "log_loss": float(found.fun),
            "log_loss_of_0": loss(0.0),
            "log_loss_as_committed": loss(committed),
        }
    finally:
        setattr(existence, constant, committed)


def main() -> None:
    """Gathers (resuming from --rows), fits, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tables", type=int, default=100, metavar="N", help="(default: 100)")
    parser.add_argument("--rows", type=Path, default=Path("recursion_rows.jsonl"), help="kept as they come")
    options = parser.parse_args()
    torch.set_num_threads(1)
    judged = [one for one in gather(options.tables, options.rows) if one.observation > 0]
    rows = [(one, dict(one.features)) for one in judged if "p_before" in dict(one.features)]
    agreed = [(f["p_look"], f["p_before"]) for one, f in rows if one.seen]
    missed = [(f["p_before"], looked_at(f)) for one, f in rows if not one.seen]
    result = {
        "tables": options.tables,
        "AGREED": learned(
            "AGREED",
            lambda: np.array([agreed_probability(now, before) for now, before in agreed]),
            np.array([one.right for one, _ in rows if one.seen]),
        ),
        "MISSED": learned(
            "MISSED",
            lambda: np.array([missed_probability(before, seen) for before, seen in missed]),
            np.array([one.right for one, _ in rows if not one.seen]),
        ),
    }
    write_whole(RESULT, json.dumps(result | made_with(), indent=2) + "\n")
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
