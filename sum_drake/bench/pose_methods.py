"""The methods that `sum-drake bench pose` compares, with what they are in words."""

import dataclasses
from typing import Any

from sum_drake.filter_config import FilterConfig, filter_config

OWN_SENSOR = "default_own_sensor"
METHODS = {
    "paper": "the published filter: 625 particles, each rendered, in each of 25 iterations",
    "default": "the default filter, taking each sensor for a structured-light camera",
    OWN_SENSOR: "the default, told the noise model of the sensor",
    "default_no_registration": "the default without registration: particles move by noise alone, no rivals at the end",
    "fast": "the default with fewer particles, iterations and rivals",
    "fpfh": "Open3D's FPFH and RANSAC, with the table taken away",
    "fpfh_icp": "the same, then point-to-plane ICP",
}
"""What each is."""
PAPER_METHODS = ("paper", "default", "fpfh", "fpfh_icp")
"""Those of the paper's experiment."""
_ABLATIONS: dict[str, tuple[str, dict[str, Any]]] = {
    "no_warmup": ("no registration of all particles before the first weighting", {"warmup": 0}),
    "no_flips": ("no half and quarter turns among the proposals", {"flipped": 0.0}),
    "no_rivals": ("the best particle, without modes that are compared by exact renders", {"candidates": 0}),
    "no_support": ("the plane about the box is like anything else", {"support": False}),
    "no_tempering": ("weights as they are, however few particles are left", {"effective_share": 0.0}),
    "no_close": ("nothing for points that match closely", {"without": ("close",)}),
    "no_contradicted": ("nothing against points where none can be", {"without": ("contradicted",)}),
    "no_sides": ("nothing for the sides of the box", {"without": ("sides",)}),
    "no_edges": ("no forgiveness at depth edges", {"without": ("edges",)}),
    "no_near_symmetries": ("rivals turned about axes alone", {"without": ("near_symmetries",)}),
    "inliers_alone": ("I / N for the score, and thus no rivals", {"score": "inliers", "candidates": 0}),
    "uniform_start": ("particles begin anywhere in the box", {"start": "uniform"}),
    "fixed_epsilon": ("the last inlier distance from the start", {"epsilon_first": FilterConfig.epsilon}),
    "any_sensor": (
        "inlier distances from 10 to 7 mm, whatever the sensor and the distance",
        {"sensor": False, "epsilon_first": 0.010, "epsilon": 0.007},
    ),
    "half_the_particles": (
        "half of the particles, from the first iteration to the last",
        {"particles": FilterConfig.particles // 2, "particles_last": FilterConfig.particles_last // 2},
    ),
}
ABLATIONS = {name: f"the default, but: {words}" for name, (words, _) in _ABLATIONS.items()}
"""Further methods: the default filter with an ingredient left out."""
ABOUT = METHODS | ABLATIONS


def filter_configs() -> dict[str, FilterConfig]:
    """The filters that are compared."""
    default = filter_config("default")
    return {
        "paper": filter_config("paper"),
        "default": default,
        OWN_SENSOR: default,
        "default_no_registration": dataclasses.replace(default, warmup=0, registered=0.0, candidates=0),
        "fast": dataclasses.replace(default, particles=800, iterations=5, candidates=4),
        **{name: dataclasses.replace(default, **changes) for name, (_, changes) in _ABLATIONS.items()},
    }
