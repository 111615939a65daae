"""Pictures of coloured cards with exact boxes, as `sum-drake dataset` writes its own, and what shows in a picture."""

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake.detection.dataset import (
    SCHEMA,
    SPLITS,
    AnnotatedObject,
    EncodedImage,
    encode_depth,
    scene_folder,
    write_scene,
)
from sum_drake.jsonio import write_json
from sum_drake.types import Camera

LABELS = ("red", "green")
COLORS = {"red": (220, 40, 30), "green": (40, 200, 60)}
CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)


def card_picture(rng):
    """A grey picture (480, 640, 3) with a card of each label, and what is on it."""
    color = rng.integers(90, 150, (480, 640, 3)).astype(np.uint8)
    objects = []
    for label, left in zip(LABELS, (20, 330), strict=True):
        w, h = (int(side) for side in rng.integers(60, 160, 2))
        x, y = left + int(rng.integers(0, 280 - w)), int(rng.integers(10, 460 - h))
        color[y : y + h, x : x + w] = COLORS[label]
        objects.append(AnnotatedObject(label, (float(x), float(y), float(w), float(h)), 1.0, w * h))
    return color, tuple(objects)


def write_cards(folder: Path, scenes: Mapping[str, int], seed: int = 0) -> Path:
    """A data set of so many scenes a split, of one picture each."""
    for split in scenes:
        for scene in range(scenes[split]):
            color, objects = card_picture(np.random.default_rng([seed, SPLITS.index(split), scene]))
            jpeg = cv2.imencode(".jpg", color[..., ::-1])[1].tobytes()
            image = EncodedImage(jpeg, encode_depth(np.ones((480, 640))), CAMERA, objects)
            scene_folder(folder, split, scene).parent.mkdir(parents=True, exist_ok=True)
            write_scene(scene_folder(folder, split, scene), [image])
    settings = {
        "schema": SCHEMA,
        "seed": seed,
        "labels": list(LABELS),
        "scenes": dict(scenes),
        "views": 1,
    }
    write_json(folder / "dataset.json", settings)
    return folder


def silhouette(image: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """What of a picture of an object (h, w, 3) is not the colour of its upper left pixel."""
    return np.asarray(np.abs(image.astype(float) - image[0, 0]).max(2) >= 3)
