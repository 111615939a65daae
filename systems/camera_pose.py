"""Where the head camera is, as the robot knows it."""

from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from sum_drake import robot


class CameraPose(LeafSystem):
    """Forward kinematics from the measured joints to the head camera.

    .. pydrake_system::

        name: CameraPose
        input_ports:
        - state
        output_ports:
        - X_WC

    The state is the robot's measured positions and velocities (24,) in the order of `robot.STATE_JOINTS`; X_WC is a
    RigidTransform (x right, y down, z forward). Nothing of the simulator's true poses enters.
    """

    def __init__(self, *, X_WB: RigidTransform) -> None:
        """
        Args:
            X_WB: pose of the robot's base in the world.
        """
        super().__init__()
        self._X_WB = X_WB
        self._state = self.DeclareVectorInputPort("state", BasicVector(2 * len(robot.STATE_JOINTS)))
        self.DeclareAbstractOutputPort(
            "X_WC",
            lambda: Value(RigidTransform()),
            self._calc_X_WC,
            prerequisites_of_calc={self._state.ticket()},
        )

    def _calc_X_WC(self, context: Context, output: Value) -> None:
        X_BC = robot.camera_pose(self._state.Eval(context))
        output.set_value(self._X_WB.multiply(RigidTransform(X_BC)))
