"""Whether the inertias that a URDF gives its links are those of bodies."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sum_drake.assets import InputError
from sum_drake.types import Array
from sum_drake.urdf import MOVING, UserJoint, name_of, number, origin_of, some_of


def check_inertias(root: ElementTree.Element, joints: Sequence[UserJoint], path: Path, notes: list[str]) -> None:
    """Refuses inertias that are nonsense, or that nothing could be turned with; notes those that are merely singular.

    Planning needs none of them, and published robots (Fetch's own fingers) have some that no body can have.
    """
    moments: dict[str, tuple[float, Array, Array]] = {}  # of a link: mass, p_LCcm (3,), I_Ccm_L (3, 3)
    odd = []
    for element in root.findall("link"):
        inertial = element.find("inertial")
        if inertial is None:
            continue
        name = name_of(element, path)
        where = f"{path}: link '{name}': inertial"
        mass = number(inertial.find("mass"), "value", "0", f"{where}: mass")
        about = inertial.find("inertia")
        xx, yy, zz, xy, xz, yz = (
            number(about, key, "0", f"{where}: inertia") for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        I = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])  # noqa: E741
        principal = np.linalg.eigvalsh(I)
        if mass < 0:
            raise InputError(f"{where}: mass is {mass:g}; expected 0 or more kilograms")
        if principal[0] < -1e-6 * max(np.abs(principal).max(), 1e-9):
            raise InputError(
                f"{where}: the inertia's principal moments are {_listed(principal)}; expected none below 0 kg m^2"
            )
        X_LC = origin_of(inertial, where)
        R = X_LC.rotation().matrix()
        moments[name] = mass, X_LC.translation(), R @ I @ R.T
        if mass > 0 and not principal[0] > 1e-9 * principal[2]:
            odd.append(f"'{name}'")
    if odd:
        notes.append(
            f"{path}: the inertia of {some_of(odd)} cannot be inverted: planning does without; to simulate the robot, "
            "expected three principal moments over 0"
        )
    for joint in joints:
        _check_turns(joint, joints, moments, path)


def _check_turns(
    joint: UserJoint, joints: Sequence[UserJoint], moments: dict[str, tuple[float, Array, Array]], path: Path
) -> None:
    """Refuses a last joint that turns a mass without any inertia about its axis: no effort turns that as it should."""
    if joint.kind not in ("revolute", "continuous"):
        return
    total, heaviest, stack = 0.0, ("", 0.0), [(joint.child, np.eye(4))]
    while stack:
        link, X_JL = stack.pop()
        further = [each for each in joints if each.parent == link]
        if any(each.kind in MOVING for each in further):
            return
        stack += [(each.child, X_JL @ each.X_PJ) for each in further]
        if link in moments:
            mass, p_LC, I_L = moments[link]
            a = X_JL[:3, :3].T @ joint.axis
            arm = np.cross(joint.axis, X_JL[:3, :3] @ p_LC + X_JL[:3, 3])
            total += float(a @ I_L @ a) + mass * float(arm @ arm)
            heaviest = max(heaviest, (link, mass), key=lambda pair: pair[1])
    if heaviest[1] > 0 and total < 1e-12:
        raise InputError(
            f"{path}: link '{heaviest[0]}': its inertia cannot be inverted: joint '{joint.name}' turns "
            f"{heaviest[1]:g} kg without any inertia about its axis; expected a positive definite inertia, or no mass"
        )


def _listed(values: Array) -> str:
    return ", ".join(f"{value:g}" for value in values)
