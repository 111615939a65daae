"""From where on the paper's score is taken for a proof: the thresholds of `bench ablations`' variants.

    python benchmarks/score_thresholds.py VARIANT=BATCH ... --out benchmarks/results/score_thresholds.json

BATCH: a folder of `sum-drake batch`, of the variant's filter; the first look of each run is judged, before anything was
done. Of the hypotheses that are within 2 cm and 20 degrees, a threshold is to keep .95: of the multiples of .05, the
largest that does. Pours of these batches are none that the variants are measured on (benchmarks/seeds.md).
"""

import argparse
import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from sum_drake.batch_folder import made_by, read_episodes
from sum_drake.jsonio import write_json
from sum_drake.runlog_reader import read_what_there_is

RIGHT = 0.02, np.deg2rad(20.0)
"""Metres and radians."""
KEPT, STEP = 0.95, 0.05


@dataclasses.dataclass(frozen=True)
class Scored:
    """A hypothesis of a first look."""

    score: float
    right: bool


def first_looks(batch: Path) -> Iterator[Scored]:
    """The hypotheses that were seen in the first look of each run."""
    for row in read_episodes(batch):
        folder = batch / str(row["seed"])
        told = json.loads((folder / "summary.json").read_text())["observations"][0]
        seen = {pose["track"]: pose for pose in told["poses"] if pose["seen"]}
        (first,) = (one for one in read_what_there_is(folder / "run.mcap").perceptions if one.step == told["step"])
        for track in first.posterior.tracks:
            if track.id in seen:
                off = seen[track.id]["translation_error_m"], seen[track.id]["rotation_error_rad"]
                right = all(error is not None and error < bound for error, bound in zip(off, RIGHT, strict=True))
                yield Scored(track.p_box * track.p_label * track.likelihood, right)


def threshold(scored: list[Scored]) -> float:
    """The largest multiple of STEP that keeps as many of the right ones as it should."""
    right = np.array([one.score for one in scored if one.right])
    steps = STEP * np.arange(round(1 / STEP))
    return float(max(step for step in steps if (right >= step).mean() >= KEPT))


def main() -> None:
    """Writes and prints them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("batches", nargs="+", metavar="VARIANT=BATCH")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    found = {}
    for name, _, folder in (text.partition("=") for text in options.batches):
        scored = list(first_looks(Path(folder)))
        at = threshold(scored)
        right, wrong = ([one.score for one in scored if one.right is kind] for kind in (True, False))
        found[name] = {
            "threshold": round(at, 2),
            "right": len(right),
            "right_kept": float(np.mean(np.array(right) >= at)),
            "right_quantiles": {str(q): float(np.quantile(right, q)) for q in (0.05, 0.25, 0.5, 0.75, 0.95)},
            "wrong": len(wrong),
            "wrong_rejected": float(np.mean(np.array(wrong) < at)) if wrong else None,
            "made_by": made_by(Path(folder)),
        }
        print(name, json.dumps({key: value for key, value in found[name].items() if key != "made_by"}))
    write_json(options.out, found)


if __name__ == "__main__":
    main()
