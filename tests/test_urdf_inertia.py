"""Inertias that are no body's: nonsense is refused, what planning can do without is a note."""

import pytest
from small_robots import BASE, BEND, FOREARM, POST, TURN, inertial, write_urdf

from sum_drake.assets import InputError
from sum_drake.user_robot import load_robot


def load(folder, text):
    forearm = FOREARM.replace("<collision>", text + "<collision>")
    return load_robot(write_urdf(folder, BASE + POST + forearm + TURN + BEND))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<inertial/>",
        inertial(0, 0, 0, 0),
        inertial(0, 1, 1, 1),
        inertial(2, 0.1, 0.1, 0.01),
        inertial(1e-5, 1e-9, 1e-9, 1e-9),
        inertial(1.5, 0.0013, 0.0019, 0.0024, ixy=-1e-18),
    ],
)
def test_what_is_usual_is_not_mentioned(tmp_path, text):
    assert load(tmp_path, text).notes == ()


@pytest.mark.parametrize(
    "text",
    [
        inertial(0.0798, 0.002, 0, 0, xyz="-0.01 0 0"),
        inertial(1, 0.1, 0.1, 0.0),
        inertial(1, 0, 0, 0, xyz="0 0 0.2"),
        inertial(1, 1, 1, 1, ixy=1.0),
    ],
)
def test_what_cannot_be_inverted_is_a_note(tmp_path, text):
    (note,) = load(tmp_path, text).notes
    assert "arm.urdf: the inertia of 'forearm' cannot be inverted" in note


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (inertial(-1, 1, 1, 1), "link 'forearm': inertial: mass is -1; expected 0 or more kilograms"),
        (inertial("heavy", 1, 1, 1), "mass: value is 'heavy'; expected a finite number"),
        (inertial(1, 1, 1, "inf"), "inertia: izz is 'inf'; expected a finite number"),
        (inertial(1, -1, 1, 1), "the inertia's principal moments are -1, 1, 1; expected none below 0"),
        (inertial(1, 1, 1, 1, ixy=2.0), "the inertia's principal moments are -1, 1, 3"),
        (inertial(1, 1, 1, 1, xyz="0 0"), "inertial: origin: xyz is '0 0'"),
        (inertial(2.5, 0, 0, 0), "'forearm': its inertia cannot be inverted: joint 'bend' turns 2.5 kg without any"),
        (inertial(1, 1, 0, 1), "joint 'bend' turns 1 kg without any inertia about its axis"),
    ],
)
def test_nonsense_is_refused_in_one_line(tmp_path, text, words):
    with pytest.raises(InputError, match=words) as caught:
        load(tmp_path, text)
    assert "\n" not in str(caught.value)
