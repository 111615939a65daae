"""Lights, background and shading of the data set's scenes.

Trained on: one to four lights, directional or points, nearly white, under Phong or, in three of ten scenes, under plain
PBR. Held out: one to three spots of strong colours under PBR, with cast shadows and filmic tone mapping. Both have a
weak light at the camera.
"""

import numpy as np
from pydrake.geometry import LightParameter, RenderEngineVtkParams, Rgba

from sum_drake.detection.textures import draw_color
from sum_drake.types import Array


def draw_look(rng: np.random.Generator, target: Array, *, shift: bool = False) -> RenderEngineVtkParams:
    """Lights about a target (3,) in W, background and shading; shift: of the kinds that are held out."""
    pbr = shift or bool(rng.random() < 0.3)
    # Drake's PBR spreads light over the hemisphere (a factor 1 / pi) where Phong does not.
    level = 2.5 if pbr else 1.0
    count = int(rng.integers(1, 4 if shift else 5))
    lights = [
        _lamp(rng, target, level * share * rng.uniform(0.8, 1.6), shift=shift) for share in rng.dirichlet([2.0] * count)
    ]
    # There is no light from all around: without one at the camera, what faces away from the lamps is black. A point
    # light casts no shadow.
    headlight = level * rng.uniform(0.15, 0.5)
    lights.append(LightParameter(type="point", frame="camera", position=[0, 0, 0], intensity=headlight))
    background = draw_color(rng)
    if not shift:
        return RenderEngineVtkParams(default_clear_color=background, lights=lights, force_to_pbr=pbr)
    return RenderEngineVtkParams(
        default_clear_color=background, lights=lights, force_to_pbr=pbr, exposure=rng.uniform(0.8, 1.6),
        cast_shadows=True, shadow_map_size=1024,
    )  # fmt: skip


def _lamp(rng: np.random.Generator, target: Array, intensity: float, *, shift: bool) -> LightParameter:
    """A light above the target that shines on it, or nearly so: far away, near, or a spot."""
    # VTK's shadow maps need lamps that are far away and aslant: otherwise round things cast specks on themselves.
    low, high = (42.0, 68.0) if shift else (25.0, 85.0)
    azimuth, elevation = rng.uniform(-np.pi, np.pi), np.radians(rng.uniform(low, high))
    towards = -direction(azimuth, elevation)
    at = target + rng.uniform(-0.2, 0.2, 3) * [1, 1, 0]
    color = _light_color(rng, rng.uniform(0.4, 0.8) if shift else rng.uniform(0, 0.25))
    kind = "spot" if shift else str(rng.choice(["directional", "point"], p=[0.7, 0.3]))
    distance = rng.uniform(3.0, 4.5) if shift else rng.uniform(0.8, 2.2)
    return LightParameter(
        type=kind, frame="world", position=at - distance * towards, direction=towards, intensity=intensity,
        color=color, cone_angle=rng.uniform(8, 14) if shift else 0.0,
    )  # fmt: skip


def direction(azimuth: float, elevation: float) -> Array:
    """Unit vector (3,) in W."""
    across = np.cos(elevation)
    return np.array([np.cos(azimuth) * across, np.sin(azimuth) * across, np.sin(elevation)])


def _light_color(rng: np.random.Generator, saturation: float) -> Rgba:
    """A light of any hue, white at saturation 0, as bright as white in its largest channel."""
    color = 1 - saturation * rng.random(3)
    return Rgba(*(color / color.max()), 1.0)
