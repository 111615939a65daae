"""Pictures of what was seen and of what is believed of it."""

import colorsys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake.geometry import apply, inverse
from sum_drake.types import Array, Camera, Frame, Perception, Track

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue, ObjectModel

Image = NDArray[np.uint8]
Color = tuple[int, int, int]
GREY: Color = (150, 150, 150)
SUBPIXEL = 4
"""Fractional bits of the coordinates handed to OpenCV."""


def label_color(label: str, catalogue: "Catalogue") -> Color:
    """RGB of a label, the same in every picture and table; neighbours in the catalogue differ most."""
    if label not in catalogue:
        return GREY
    return nth_color(catalogue.labels.index(label))


def nth_color(index: int) -> Color:
    """RGB of the label of that index; neighbours differ most."""
    r, g, b = colorsys.hls_to_rgb((0.08 + 0.618034 * index) % 1.0, (0.42, 0.55, 0.70)[index % 3], 0.85)
    return round(255 * r), round(255 * g), round(255 * b)


def draw_perception(perception: Perception, catalogue: "Catalogue", *, scale: int = 2) -> Image:
    """The picture of an observation with what was made of it, (scale h, scale w, 3) RGB.

    Thin boxes are detections. Filled outlines with axes are accepted tracks, dashed outlines rejected or unseen ones;
    each carries its label and probability.
    """
    frame = perception.frame
    image = np.asarray(cv2.resize(frame.color, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC), np.uint8)
    canvas = _Canvas(image, frame.camera, scale)
    for detection in perception.detections:
        label = detection.p_labels[0][0] if detection.p_labels else ""
        canvas.box(detection.box, label_color(label, catalogue))
    # The sure ones last: they lie on top.
    tracks = sorted(perception.posterior.tracks, key=lambda track: (track.accepted, track.probability))
    X_CW = inverse(frame.X_WC)
    for track in tracks:
        color, X_CO = label_color(track.label, catalogue), X_CW @ track.X_WO
        if track.label in catalogue:
            mesh = catalogue[track.label].load_mesh()
            canvas.outline(apply(X_CO, np.asarray(mesh.vertices)), np.asarray(mesh.faces), color, strong=track.accepted)
        if track.accepted:
            canvas.axes(X_CO)
    for track in reversed(tracks):
        canvas.tag(track, X_CW @ track.X_WO, label_color(track.label, catalogue), frame.observation)
    return canvas.image


def draw_poses(
    image: Image, frame: Frame, model: "ObjectModel", poses: Sequence[tuple[Array, Color]], *, scale: int = 2
) -> Image:
    """A picture of a frame's size with outlines of an object at poses X_WO (4, 4), enlarged by `scale`."""
    enlarged = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
    canvas = _Canvas(np.asarray(enlarged, np.uint8), frame.camera, scale)
    mesh = model.load_mesh()
    for X_WO, color in poses:
        p_C = apply(inverse(frame.X_WC) @ X_WO, np.asarray(mesh.vertices))
        canvas.outline(p_C, np.asarray(mesh.faces), color, strong=False)
    return canvas.image


def draw_depth(depth: NDArray[np.float32]) -> Image:
    """Depth (h, w) as colours, near is bright, black where nothing was returned; (h, w, 3) RGB."""
    valid = depth > 0
    if not valid.any():
        return np.zeros((*depth.shape, 3), np.uint8)
    # By rank rather than by value: what stands on the table differs little in depth from the table.
    level = np.zeros(depth.shape, np.uint8)
    level[valid] = 255 - (255 * np.searchsorted(np.sort(depth[valid]), depth[valid]) / valid.sum()).astype(np.uint8)
    colors = cv2.cvtColor(cv2.applyColorMap(level, cv2.COLORMAP_VIRIDIS), cv2.COLOR_BGR2RGB)
    colors[~valid] = 0
    return np.asarray(colors, np.uint8)


def verdict(track: Track, observation: int) -> str:
    """What became of a track in an observation, in words."""
    if track.accepted:
        return "accepted"
    return "rejected" if track.seen == observation else "not seen"


class _Canvas:
    """An enlarged picture and the camera that took it."""

    def __init__(self, image: Image, camera: Camera, scale: int) -> None:
        self.image, self._camera, self._scale = image, camera, scale
        self._tags: list[tuple[int, int, int, int]] = []

    def _pixels(self, p_C: Array) -> Array:
        """Enlarged pixel coordinates (n, 2) of points (n, 3) in front of the camera."""
        c = self._camera
        uv = p_C[:, :2] / p_C[:, 2:] * [c.fx, c.fy] + [c.cx, c.cy]
        return np.asarray((uv + 0.5) * self._scale - 0.5)

    def box(self, box: tuple[float, float, float, float], color: Color) -> None:
        x, y, w, h = (value * self._scale for value in box)
        left, top, right, bottom = (round(float(np.clip(v, -1e4, 1e4))) for v in (x, y, x + w - 1, y + h - 1))
        cv2.rectangle(self.image, (left, top), (right, bottom), color, 1, cv2.LINE_AA)

    def outline(self, p_C: Array, faces: NDArray[np.int64], color: Color, *, strong: bool) -> None:
        """The silhouette of a mesh, filled when strong."""
        if not (p_C[:, 2] > 0.05).all():
            return
        uv = np.clip(self._pixels(p_C), -1e4, 1e4)
        mask = np.zeros(self.image.shape[:2], np.uint8)
        for triangle in np.round(uv * 2**SUBPIXEL).astype(np.int32)[faces]:
            cv2.fillConvexPoly(mask, triangle, 255, cv2.LINE_8, SUBPIXEL)
        contours, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        if strong:
            inside = mask > 0
            self.image[inside] = (0.75 * self.image[inside] + 0.25 * np.array(color)).astype(np.uint8)
            cv2.drawContours(self.image, contours, -1, (0, 0, 0), 4, cv2.LINE_AA)
            cv2.drawContours(self.image, contours, -1, color, 2, cv2.LINE_AA)
        else:
            dashes = [contour[i : i + 8] for contour in contours for i in range(0, len(contour), 14)]
            cv2.polylines(self.image, dashes, False, color, 2, cv2.LINE_AA)

    def axes(self, X_CO: Array, length: float = 0.05) -> None:
        """x red, y green, z blue."""
        ends = apply(X_CO, np.vstack([np.zeros(3), length * np.eye(3)]))
        if not (ends[:, 2] > 0.05).all():
            return
        origin, *tips = (tuple(int(value) for value in point) for point in np.round(self._pixels(ends)))
        for tip, color in zip(tips, ((230, 40, 40), (40, 200, 40), (60, 90, 255)), strict=True):
            cv2.arrowedLine(self.image, origin, tip, (255, 255, 255), 4, cv2.LINE_AA, tipLength=0.2)
            cv2.arrowedLine(self.image, origin, tip, color, 2, cv2.LINE_AA, tipLength=0.2)

    def tag(self, track: Track, X_CO: Array, color: Color, observation: int) -> None:
        """Label and probability over the estimate, moved down until it covers no other."""
        if X_CO[2, 3] <= 0.05:
            return
        text = f"{track.label} {track.probability:.2f}" + ("" if track.accepted else f" {verdict(track, observation)}")
        size = 0.55 if track.accepted else 0.45
        (width, height), baseline = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
        width, height = width + 8, height + baseline + 4
        (center,) = self._pixels(X_CO[None, :3, 3])
        rows, columns = self.image.shape[:2]
        x = int(np.clip(center[0] - width / 2, 0, max(columns - width, 0)))
        y = int(np.clip(center[1] + 8, 0, max(rows - height, 0)))
        while any(x < x1 + w1 and x1 < x + width and y < y1 + h1 and y1 < y + height for x1, y1, w1, h1 in self._tags):
            y += 2
        self._tags.append((x, y, width, height))
        dark, bright = (24, 24, 24), (255, 255, 255)
        background = color if track.accepted else dark
        ink = dark if np.dot(background, (0.299, 0.587, 0.114)) > 110 else bright
        cv2.rectangle(self.image, (x, y), (x + width, y + height), background, cv2.FILLED)
        at = (x + 4, y + height - baseline - 1)
        cv2.putText(self.image, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, ink, 1, cv2.LINE_AA)
