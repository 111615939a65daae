"""How near the estimates on a frame come to poses that are known: `sum-drake estimate` with several seeds, judged.

    python benchmarks/real_frame.py FRAME --catalogue FILE --seeds 5

FRAME is a frame folder with detections.json and a truth.json, a list of {label, X_CO (4 x 4, metres)}, perhaps with a
symmetry as in catalogues. A label occurs once. An estimate is right within 2 cm and 15 degrees, over the symmetry;
beside it ADD-S.
"""

import argparse
import dataclasses
import json
import sys
from pathlib import Path

import numpy as np

from sum_drake.assets import InputError
from sum_drake.bench.pose_figures import errors
from sum_drake.estimates import estimate_frame
from sum_drake.filter_config import FILTERS, filter_config
from sum_drake.filtering import PoseEstimator
from sum_drake.frame_folder import read_frame
from sum_drake.geometry import symmetry_group
from sum_drake.objects import load_catalogue

RIGHT = 0.02, 15.0
"""Metres and degrees."""
NEAR = 0.01
"""ADD-S, metres."""


def main() -> None:
    """Estimates and prints a line an estimate, then the shares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frame", type=Path)
    parser.add_argument("--catalogue", type=Path)
    parser.add_argument("--seeds", type=int, default=5, metavar="N")
    parser.add_argument("--filter", choices=FILTERS, default="default")
    options = parser.parse_args()
    catalogue, read = load_catalogue(options.catalogue), read_frame(options.frame)
    truth, models = {}, {}
    if not (options.frame / "truth.json").is_file():
        raise InputError(f"{options.frame}: no truth.json; expected a list of {{label, X_CO}}")
    for row in json.loads((options.frame / "truth.json").read_text()):
        if row["label"] not in catalogue:
            raise InputError(f"the catalogue has no '{row['label']}' of truth.json; expected --catalogue with it")
        model = catalogue[row["label"]]
        symmetry = symmetry_group(row["symmetry"]) if "symmetry" in row else model.symmetry
        models[model.label] = dataclasses.replace(model, symmetry=symmetry)
        truth[model.label] = np.array(row["X_CO"])
    estimator = PoseEstimator(catalogue, filter_config(options.filter), noise=read.noise)
    boxes = [one for one in read.boxes or () if one.label in truth]
    strict, near, stated = [], [], []
    print("seed label                  mm   deg  raw deg  ADD-S mm  stated")
    for seed in range(options.seeds):
        for found in estimate_frame(read.frame, boxes, catalogue, estimator, seed=seed):
            shift, angle, raw, adds = errors(models[found.label], found.X_CO, truth[found.label])
            strict.append(shift < RIGHT[0] and angle < RIGHT[1])
            near.append(adds < NEAR)
            stated.append(found.probability)
            print(
                f"{seed:4} {found.label:20} {1e3 * shift:5.1f} {angle:5.1f} {raw:8.1f} {1e3 * adds:9.1f} "
                f"{found.probability:7.2f}"
            )
    print(
        f"{len(strict)} estimates: {np.mean(strict):.2f} within 2 cm and 15 degrees, {np.mean(near):.2f} with ADD-S "
        f"under 1 cm; stated {np.mean(stated):.2f}"
    )


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(str(error))
