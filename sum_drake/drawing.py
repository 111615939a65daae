"""Pictures of what was seen and of what is believed of it."""

import colorsys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from sum_drake.geometry import apply, inverse
from sum_drake.robot import HAND
from sum_drake.types import Array, Camera, Frame, Perception, PickPlace, Track

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue, ObjectModel

Image = NDArray[np.uint8]
Color = tuple[int, int, int]
GREY: Color = (150, 150, 150)
PALM_COLOR: Color = (255, 255, 255)
FINGER_COLOR: Color = (255, 214, 0)
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


def draw_grasp(
    look: Perception, action: PickPlace, catalogue: "Catalogue", *, size: tuple[int, int] = (480, 360)
) -> Image:
    """What a look saw of what was grasped after it, with the hand where it was to close, (h, w, 3) RGB for (w, h).

    The object is outlined as it was believed; the hand is drawn as boxes, opened as wide as it was after the lift, or
    wholly where it then held nothing.
    """
    frame, scale = look.frame, 2
    image = np.asarray(cv2.resize(frame.color, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC), np.uint8)
    canvas = _Canvas(image, frame.camera, scale)
    X_CW = inverse(frame.X_WC)
    gap = HAND.gap_max if action.held_lift is False or action.gap_lift < 1e-3 else action.gap_lift
    boxes_C = [apply(X_CW @ action.X_WG_pick, corners) for corners in hand_boxes(gap)]
    shown = [*boxes_C]
    target = next((track for track in look.posterior.tracks if track.id == action.track), None)
    if target is not None and target.label in catalogue:
        mesh = catalogue[target.label].load_mesh()
        p_C = apply(X_CW @ target.X_WO, np.asarray(mesh.vertices))
        canvas.outline(p_C, np.asarray(mesh.faces), label_color(target.label, catalogue), strong=True)
        shown.append(p_C)
    for corners, color in zip(boxes_C, (PALM_COLOR, FINGER_COLOR, FINGER_COLOR), strict=True):
        canvas.wire(corners, color)
    return canvas.around(np.concatenate(shown), size)


def hand_boxes(gap: float) -> Array:
    """Corners (3, 8, 3) in G of the palm and of two fingers `gap` apart; low before high, z changes first."""
    z, inner, outer = HAND.pad_half_width, gap / 2, gap / 2 + HAND.pad_thickness
    y_palm, z_palm = HAND.palm_half
    extents = [
        (HAND.palm_x, (-y_palm, y_palm), (-z_palm, z_palm)),
        (HAND.pad_x, (inner, outer), (-z, z)),
        (HAND.pad_x, (-outer, -inner), (-z, z)),
    ]
    return np.array([np.stack(np.meshgrid(*sides, indexing="ij"), -1).reshape(8, 3) for sides in extents])


def footprint(vertices: Array, faces: NDArray[np.int64], *, pixel: float = 0.002) -> list[Array]:
    """The silhouette of a mesh (v, 3), (f, 3) seen along -z: outlines (n, 2) in x and y, metres, holes among them."""
    p = vertices[:, :2]
    corner = p.min(0) - 2 * pixel
    columns, rows = np.ceil((p.max(0) - corner) / pixel).astype(int) + 3
    mask = np.zeros((rows, columns), np.uint8)
    for triangle in np.round((p - corner) / pixel * 2**SUBPIXEL).astype(np.int32)[faces]:
        cv2.fillConvexPoly(mask, triangle, 255, cv2.LINE_8, SUBPIXEL)
    contours, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    smooth = [cv2.approxPolyDP(contour, 0.8, True)[:, 0] for contour in contours]
    return [corner + pixel * np.asarray(outline, float) for outline in smooth if len(outline) > 2]


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

    def wire(self, corners_C: Array, color: Color) -> None:
        """The edges of a box by its corners (8, 3), as `hand_boxes` orders them."""
        if not (corners_C[:, 2] > 0.05).all():
            return
        uv = np.round(np.clip(self._pixels(corners_C), -1e4, 1e4)).astype(int)
        edges = [(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit]
        for ink, width in (((20, 20, 20), 4), (color, 2)):
            for i, j in edges:
                cv2.line(self.image, tuple(map(int, uv[i])), tuple(map(int, uv[j])), ink, width, cv2.LINE_AA)

    def around(self, p_C: Array, size: tuple[int, int]) -> Image:
        """The part of the picture about points (n, 3) with as much again around them, (h, w, 3) for a size (w, h).

        Where they are not in the picture, as much of its middle as the size's shape allows.
        """
        rows, columns = self.image.shape[:2]
        low, high = np.zeros(2), np.array([columns, rows], float)
        ahead = p_C[p_C[:, 2] > 0.05]
        if len(ahead):
            uv = np.clip(self._pixels(ahead), low, high)
            if (np.ptp(uv, axis=0) > 0).all():
                low, high = uv.min(0), uv.max(0)
        middle, (w, h) = (low + high) / 2, size
        wide = max(1.5 * (high - low)[0], 1.5 * (high - low)[1] * w / h, columns / 3)
        wide = min(wide, columns, rows * w / h)
        half = np.array([wide, wide * h / w]) / 2
        left, top = np.round(np.clip(middle - half, 0, [columns, rows] - 2 * half)).astype(int)
        part = self.image[top : top + max(round(2 * half[1]), 1), left : left + max(round(2 * half[0]), 1)]
        return np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_AREA), np.uint8)

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
