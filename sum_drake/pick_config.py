"""How a pick, a place and a retreat are planned: the settings of `picking` and `retreat`."""

import dataclasses


@dataclasses.dataclass
class PickConfig:
    """Planning of one pick and place; SI units."""

    approach: float = 0.09
    """The hand stops this far short of the grasp, then reaches straight."""
    lifts: list[float] = dataclasses.field(default_factory=lambda: [0.18, 0.26, 0.12])
    """Heights of the straight lift; the first that the arm can do, and that clears what stands around, is taken."""
    retreats: list[float] = dataclasses.field(default_factory=lambda: [0.14, 0.09, 0.07])
    """Lengths of the straight retreat after the release, likewise; the pads are .062 m long."""
    release: float = 0.025
    """To let go, the fingers open by at least this much more than for the approach, if the object leaves the room."""
    release_clearance: float = 0.004
    """Free space between an opened finger and the parts of the object that lie beyond it, such as a mug's far wall."""
    furniture_padding: float = 0.01
    """Distance that the arm keeps from table and bins while it goes around things."""
    solid_padding: float = 0.006
    """The same from believed objects and unexplained points."""
    self_padding: float = 0.005
    """The same from the robot itself."""
    reach_padding: float = 0.002
    """Distance from table and bins during reach, lift and retreat; the object itself and its points do not count."""
    neighbour_paddings: list[float] = dataclasses.field(default_factory=lambda: [0.005, 0.0])
    """The same from believed neighbours: the first with which there is any way. The arm follows its plan to a few
    millimetres, and whoever brushes a neighbour is stopped."""
    explained: float = 0.012
    """Depth points this close to a believed object are that object, not obstacles of their own."""
    point_size: float = 0.015
    """Edge of the boxes that cover unexplained points."""
    grasps: int = 60
    """Grasps examined: two thirds the best ranked, one third spread over the rest."""
    places: int = 18
    """Grasps for which a place is searched before the object is given up."""
    searches: int = 6
    """Grasps for which paths are searched before the object is given up."""
    budget: int = 1500
    """Calls of the termination condition in one path search."""
    speed: float = 1.0
    """Share of the joints' speed that the arm goes around things with."""
    straight_speed: float = 1.0
    """The same for reach, lift and retreat."""
    release_heights: list[float] = dataclasses.field(default_factory=lambda: [0.04, 0.08, 0.13, 0.19, 0.26, 0.33, 0.40])
    """Height of the object's lowest point above the region's floor, or above `fill`, when it is let go."""
    gentle: float = 0.26
    """From higher it is let fall only where no grasp allows less."""
    lower: float = 0.06
    """Length of the straight way down to a place on the table."""
    close_time: float = 1.0
    """Seconds given to the fingers to close and to press."""
    open_time: float = 0.3
    """Seconds that the arm stands still after the fingers have been told to open, and have had the time to."""
