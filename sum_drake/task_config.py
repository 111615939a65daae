"""Choices of the sorting task."""

import dataclasses


@dataclasses.dataclass
class TaskConfig:
    """Choices of the task that are not geometry."""

    policy: str = "most_likely"
    """Which accepted object comes first, one of `prospects.POLICIES`; most_likely is the paper's."""
    spare_neighbours: bool = True
    """Whether an object by whose lift others may fall off the table is taken last; the paper does not ask."""
    max_attempts: int = 3
    """Tries at one label before it is left, until another is brought away; twice as many in all."""
    remember: bool = True
    """Whether a grasp like one that failed is not tried again."""
    least_sure: float = 0.2
    """By `surest`, an object that promises less is taken only where nothing can be moved for its sake."""
    max_moves: int = 2
    """Times that an object of one label is moved to make way, or to be grasped anew."""
    max_helpers: int = 3
    """Objects for which such a move is planned after one look."""
    max_looks: int = 3
    """Observations in a row that lead to nothing before the run stops."""
    clear_points: int = 150
    """The table counts as clear with fewer depth pixels than this standing on it."""
    clear_height: float = 0.012
    """What stands less than this above the table is not seen as an object, metres."""
    max_obstacle_points: int = 3000
    """Depth points kept as obstacles."""
    fill_per_object: float = 0.05
    """How much higher the robot takes a region to be filled for each object it has let go there, metres."""
    fill_max: float = 0.16
    """The most it takes a region to be filled, metres."""
