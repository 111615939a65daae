"""Settings of the pose filter, and its presets: the filter as published, and our own."""

import dataclasses

from sum_drake.assets import InputError

FILTERS = ("default", "paper")
"""Names of the presets."""

INGREDIENTS = ("close", "contradicted", "sides", "edges", "near_symmetries", "table")
"""What a filter of our own can be `without`."""
_CHOICES = {"render": ("views", "each"), "start": ("surface", "uniform"), "score": ("difference", "inliers")}


@dataclasses.dataclass
class FilterConfig:
    """Settings of the pose filter, metres and radians. The defaults are the preset "default", see `filter_config`."""

    render: str = "views"
    """"views": look up what a pose shows among renders from many directions; "each": render every particle anew."""
    start: str = "surface"
    """"surface": particles begin with a point of theirs on one that was observed in the box, turned evenly all ways;
    "uniform": anywhere on the rays of the box within the observed depths, turned at random."""
    score: str = "difference"
    """What particles are weighted by. "difference": `likelihood.log_likelihood`, of inliers, points in observed free
    space and the box's sides; the estimate then gets `likelihood.confidence`. "inliers": I / N, eq. 8, for both."""
    support: bool = True
    """Whether the plane around the box, if there is one, is taken for what the object stands on."""
    particles: int = 2500
    """At the start."""
    particles_last: int = 250
    """In the last iteration; their number falls geometrically."""
    iterations: int = 10
    """Of weighting and resampling."""
    warmup: int = 4
    """Registration steps that all particles take before the first weighting."""
    registered: float = 0.7
    """Share of particles proposed by a registration step from their own render, after a little noise."""
    flipped: float = 0.1
    """Share of particles proposed by a half or quarter turn about an axis of the object, through its middle."""
    fresh: float = 0.25
    """Share of particles started from the box when there is a prior to go on from."""
    tracking_particles: int = 150
    """At the start, when there is a prior to go on from."""
    tracking_particles_last: int = 125
    """The same for the last iteration, and the belief."""
    tracking_iterations: int = 2
    """The same for iterations."""
    tracking_candidates: int = 8
    """The same for candidates, if there are any."""
    tracking_loss: float = 0.1
    """A tracked estimate whose likelihood is smaller than before by more is sought from scratch as well: the object may
    have moved."""
    prior_trust: float = 0.9
    """Of a prior, the share that counts in the posterior; the rest says that the object may be anywhere."""
    epsilon_first: float = 0.0084
    """Inlier distance of the first iteration, under a perfect sensor; falls geometrically."""
    epsilon: float = 0.0043
    """Inlier distance of the last iteration, under a perfect sensor."""
    sensor: bool = True
    """Whether the noise of the depth sensor, at the box's distance, makes inlier distances larger: by `depth_tolerance`
    to 7 mm at .9 m from a structured-light camera."""
    noise_translation_first: float = 0.01
    """Standard deviation, on each axis, of the transition noise of the first iteration; falls geometrically."""
    noise_translation: float = 0.002
    """The same for the last iteration."""
    noise_rotation_first: float = 0.2
    """The same for rotation vectors, first iteration."""
    noise_rotation: float = 0.03
    """The same, last iteration."""
    effective_share: float = 0.15
    """Weights are raised to the power at which their effective sample size is this share of the particles; 0: as is."""
    candidates: int = 16
    """Modes that are turned, registered and compared by exact renders at the end; 0: the best particle is taken."""
    without: tuple[str, ...] = ()
    """Of INGREDIENTS, what is left out to see what it is worth: a term of `likelihood.TERMS`, forgiveness at depth
    edges, or the mesh's near symmetries among the rivals."""
    w_place: float = 0.8
    """w1 of eq. 10: probability that a pick and place did what it should. The paper leaves it open."""
    sigma_place: float = 0.04
    """sigma1 of eq. 10."""
    sigma_stay: float = 0.02
    """sigma2 of eq. 10."""
    sigma_other: float = 0.01
    """sigma3 of eq. 10."""
    by_feel: bool = True
    """Whether what the hand felt decides the shares of an action's target; else w_place, w_slipped and w_dropped do."""
    w_slipped: float = 0.05
    """Share of a target's particles that lie about where it was: it slipped out of the hand. Not in the paper."""
    w_dropped: float = 0.05
    """Share of them on the way to the place, turned anyhow. Not in the paper."""
    w_swept: float = 0.2
    """Share of another object's particles, if it lies on the hand's way, that were swept aside. Not in the paper."""
    radians_per_metre: float = 10.0
    """Rotation noise of the action model per metre of sigma, which the paper leaves open: .04 m go with .4 rad."""

    def __post_init__(self) -> None:
        for field, known in _CHOICES.items():
            if getattr(self, field) not in known:
                expected = " or ".join(map(repr, known))
                raise InputError(f"filter.{field}: {getattr(self, field)!r} is unknown; expected {expected}")
        for name in self.without:
            if name not in INGREDIENTS:
                raise InputError(f"filter.without: {name!r} is unknown; expected some of {', '.join(INGREDIENTS)}")
        if self.render == "each" and (self.warmup > 0 or self.registered > 0 or self.candidates > 0):
            raise InputError("filter: registration needs the normals that render: views has; render: each has none")
        if self.score == "inliers" and self.candidates > 0:
            raise InputError("filter: rivals are compared by score: difference; expected candidates: 0 with inliers")


def filter_config(name: str = "default") -> FilterConfig:
    """The preset of a name. Raises InputError for an unknown one.

    "paper" is Sui et al. 2017: 625 particles, 25 iterations, likelihood I / N with epsilon = 8 mm (eq. 8, 9), weights
    normalised and resampled by importance in each iteration (eq. 7), uniform start. The paper leaves open, and we take:
    the transition noise, constant at 1 cm and .1 rad; N, the observed points in the box; the start, a pixel uniform
    over the box, a depth uniform between the nearest and the farthest observation in it (its 5th and 95th percentile)
    plus up to the object's radius, and an orientation uniform over SO(3).
    """
    if name == "default":
        return FilterConfig()
    if name == "paper":
        return FilterConfig(
            render="each",
            start="uniform",
            score="inliers",
            support=False,
            particles=625,
            particles_last=625,
            iterations=25,
            warmup=0,
            registered=0.0,
            flipped=0.0,
            fresh=0.0,
            tracking_particles=625,
            tracking_particles_last=625,
            tracking_iterations=25,
            epsilon_first=0.008,
            epsilon=0.008,
            sensor=False,
            noise_translation_first=0.01,
            noise_translation=0.01,
            noise_rotation_first=0.1,
            noise_rotation=0.1,
            effective_share=0.0,
            candidates=0,
            by_feel=False,
            w_slipped=0.0,
            w_dropped=0.0,
            w_swept=0.0,
        )
    raise InputError(f"filter: {name!r} is unknown; expected one of {', '.join(FILTERS)}")
