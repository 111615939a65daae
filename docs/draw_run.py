"""Draws the README's moving picture from a run folder: the film of `sum-drake report`, as an animated WebP.

python docs/draw_run.py runs/5 docs/run.webp
"""

import argparse
from pathlib import Path

from PIL import Image  # with matplotlib, which drake needs

from sum_drake.film import film
from sum_drake.run_folder import catalogue_of_run, read_run_folder
from sum_drake.storyboard import storyboard

SHOTS, FPS, SIZE, QUALITY = 120, 8.0, (560, 420), 55


def main() -> None:
    """Reads the run, writes the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="run folder")
    parser.add_argument("picture", type=Path, help="WebP to write")
    options = parser.parse_args()
    run = read_run_folder(options.run)
    if run.record is None:
        parser.error(f"{options.run}: no log to draw from")
    catalogue, _ = catalogue_of_run(run)
    board = storyboard(run.record, catalogue, run.regions(), shots=SHOTS, fps=FPS)
    pictures = [Image.fromarray(image) for image in film(board, catalogue, run.record.joint_names, size=SIZE)]
    pictures[0].save(
        options.picture, save_all=True, append_images=pictures[1:], duration=round(1000 / FPS), loop=0, quality=QUALITY
    )  # fmt: skip
    print(f"{options.picture}: {len(pictures)} pictures, {board.speed:.1f} times as fast as it was")


if __name__ == "__main__":
    main()
