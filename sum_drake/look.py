"""How the station is lit."""

import numpy as np
from pydrake.geometry import LightParameter, RenderEngineVtkParams


def station_look() -> RenderEngineVtkParams:
    """A bright room: light over the left shoulder, weaker from the right and from ahead, and some from the camera."""

    def light(direction: tuple[float, float, float], intensity: float, frame: str = "world") -> LightParameter:
        return LightParameter(type="directional", direction=direction, intensity=intensity, frame=frame)

    return RenderEngineVtkParams(
        default_clear_color=np.array([0.86, 0.89, 0.92]),
        lights=[
            light((0.8, -0.5, -1.0), 0.54),
            light((0.1, 0.8, -0.7), 0.28),
            light((-0.9, 0.2, -0.5), 0.30),
            light((0.0, 0.0, 1.0), 0.44, "camera"),
        ],
    )
