"""A user's planning problems: what is read, what is refused, and why a start or goal cannot be used."""

import json
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_robots import ARM, FOLLOWER, write_urdf

from sum_drake.assets import InputError
from sum_drake.planning_problems import STANDING, collisions, load_problems, problem_checker, refusal
from sum_drake.user_robot import load_robot, plant_positions

BALL = {"id": "ball", "type": "sphere", "dimensions": [0.1], "position": [0.3, 0, 0.5], "quat_xyzw": [0, 0, 0, 1]}
PROBLEM = {"request": "a", "joints": ["turn", "bend"], "start": [0, 0], "goal": [0, 1.5], "obstacles": []}


def test_of_a_robot_without_movable_joints_that_is_said(tmp_path):
    still = load_robot(write_urdf(tmp_path, '<link name="base"/>'))
    with pytest.raises(InputError, match=r"has no 'turn'; expected a robot with movable joints, this one has none$"):
        read(still, PROBLEM)


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return load_robot(write_urdf(tmp_path_factory.mktemp("robot")))


def read(robot, *entries):
    path = robot.path.parent / "problems.json"
    path.write_text(json.dumps(list(entries)))
    return load_problems(path, robot)


def said(robot, which="start", **change):
    (problem,) = read(robot, PROBLEM | change)
    return refusal(problem_checker(robot, problem), robot, problem, which)


def test_what_is_there_is_read(robot):
    other = {"request": 7, "joints": ["bend"], "start": [-1], "goal": [1.25], "obstacles": [BALL, BALL], "note": "x"}
    first, second = read(robot, PROBLEM, other)
    assert (first.request, first.joints, first.obstacles) == ("a", ("turn", "bend"), ())
    np.testing.assert_array_equal(first.goal, [0, 1.5])
    assert (second.request, second.joints, second.start.tolist()) == ("7", ("bend",), [-1.0])
    assert [obstacle.name for obstacle in second.obstacles] == ["ball", "ball#2"]
    np.testing.assert_array_equal(second.obstacles[0].X_WO[:3, 3], BALL["position"])


@pytest.mark.parametrize(
    ("obstacle", "free"),
    [
        # Bent forward the forearm fills x = .1 to .4 m at y, z within .02 m of (0, .5) m.
        ({"type": "box", "dimensions": [0.02, 0.02, 1.0], "position": [0.45, 0, 0.5]}, True),
        ({"type": "box", "dimensions": [1.0, 0.02, 0.02], "position": [0.85, 0, 0.5]}, False),
        ({"type": "box", "dimensions": [0.02, 1.0, 0.02], "position": [0.45, 0, 0.5]}, True),
        ({"type": "cylinder", "dimensions": [1.0, 0.01], "position": [0.45, 0, 0.5]}, True),
        ({"type": "cylinder", "dimensions": [0.02, 0.06], "position": [0.45, 0, 0.5]}, False),
        (
            {
                "type": "cylinder",
                "dimensions": [1.0, 0.01],
                "position": [0.85, 0, 0.5],
                "quat_xyzw": [0, 0.7071, 0, 0.7071],
            },
            False,
        ),
        (
            {
                "type": "cylinder",
                "dimensions": [1.0, 0.01],
                "position": [0.85, 0, 0.5],
                "quat_xyzw": [0.7071, 0, 0, 0.7071],
            },
            True,
        ),
        ({"type": "sphere", "dimensions": [0.06], "position": [0.45, 0, 0.5]}, False),
        ({"type": "sphere", "dimensions": [0.04], "position": [0.45, 0, 0.5]}, True),
    ],
)
def test_obstacles_stand_as_the_format_says(robot, obstacle, free):
    reason = said(robot, start=[0, np.pi / 2], obstacles=[BALL | obstacle | {"id": "thing"}])
    assert (reason is None) == free
    assert free or reason.startswith("start in collision: forearm with thing, ")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"request": None}, "problem 0: request is None; expected a name"),
        ({"joints": []}, r"problem 0 \('a'\): joints is \[\]; expected a list of names of joints"),
        ({"joints": ["turn", "twist"]}, "joints: the robot has no 'twist'; expected some of turn, bend"),
        ({"joints": ["turn", "turn"]}, "joints: 'turn' is there twice"),
        ({"joints": ["bend"]}, r"start is \[0, 0\] \(2 values\); expected 1 finite number,"),
        ({"start": [0]}, r"start is \[0\] \(1 values\); expected 2 finite numbers"),
        ({"goal": [0, float("nan")]}, r"goal is \[0, nan\]; expected 2 finite numbers"),
        ({"goal": [0, 10**400]}, r"goal is \[0, 1000*.*; expected 2 finite numbers"),
        ({"goal": [0, True]}, "goal is"),
        ({"goal": "home"}, "goal is 'home'; expected 2 finite numbers"),
        ({"obstacles": {}}, "obstacles is {}; expected a list"),
        ({"obstacles": [3]}, r"problem 0 \('a'\): obstacle 0: is no object"),
        ({"obstacles": [BALL | {"id": ""}]}, "obstacle 0: id is ''; expected a name"),
        (
            {"obstacles": [BALL, BALL | {"type": "cone"}]},
            r"obstacle 1 \('ball'\): type is 'cone'; expected one of box, cyl",
        ),
        ({"obstacles": [BALL | {"type": ["box"]}]}, r"type is \['box'\]"),
        (
            {"obstacles": [BALL | {"dimensions": [0.1, 0.2]}]},
            r"dimensions is \[0.1, 0.2\] \(2 values\); expected 1 finite",
        ),
        ({"obstacles": [BALL | {"dimensions": [0]}]}, r"dimensions is \[0\]; expected radius over 0 metres"),
        (
            {"obstacles": [BALL | {"position": [1e300, 0, 0]}]},
            r"position is \[1e\+300, 0, 0\]; expected 3 finite numbers",
        ),
        ({"obstacles": [BALL | {"quat_xyzw": [0, 0, 0, 2]}]}, "quat_xyzw has the length 2; expected a unit quaternion"),
        ({"obstacles": [BALL | {"quat_xyzw": [0, 0, 0, 0]}]}, "quat_xyzw has the length 0"),
    ],
)
def test_problems_that_cannot_be_used(robot, change, words):
    with pytest.raises(InputError, match=words) as caught:
        read(robot, PROBLEM | change)
    assert "\n" not in str(caught.value)
    assert "problems.json" in str(caught.value)
    for key in change:
        lacking = {name: value for name, value in PROBLEM.items() if name != key}
        with pytest.raises(InputError, match=f"problem 1.*: {key} is missing; expected"):
            read(robot, PROBLEM, lacking)


def test_names_may_be_anything_but_blank(robot):
    (problem,) = read(
        robot, PROBLEM | {"request": "a\nb", "obstacles": [BALL | {"id": name} for name in ("x", " x\n", "x::y")]}
    )
    assert problem.request == "a\nb", "as it is in the file"
    assert [obstacle.name for obstacle in problem.obstacles] == ["x", "x#2", "x::y"]
    assert refusal(problem_checker(robot, problem), robot, problem, "goal").count("forearm with x") == 3
    for change in ({"request": " "}, {"obstacles": [BALL | {"id": "\n"}]}, {"joints": ["a\nb"]}):
        with pytest.raises(InputError) as caught:
            read(robot, PROBLEM | change)
        assert "\n" not in str(caught.value)


def test_files_that_are_no_problems(robot, tmp_path):
    for content, words in (("{}", "is no list of problems"), ("[]", "is no list"), ("[1]", "problem 0: is no object"),
                           ("[", "expected JSON"), ("[" * 100_000, "expected JSON")):  # fmt: skip
        (tmp_path / "p.json").write_text(content)
        with pytest.raises(InputError, match=words):
            load_problems(tmp_path / "p.json", robot)
    (tmp_path / "p.json").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="expected JSON"):
        load_problems(tmp_path / "p.json", robot)
    with pytest.raises(InputError, match="No such file or directory; expected a file of planning problems"):
        load_problems(tmp_path / "none.json", robot)


def test_joints_that_cannot_be_planned_for_are_said_to_be_so(tmp_path):
    robot = load_robot(write_urdf(tmp_path, ARM + FOLLOWER.format("lead", 0)))
    for name, words in (("slide", "'slide' mimics 'lead'"), ("lead", "'lead' is mimicked by 'slide'")):
        with pytest.raises(InputError, match=words):
            read(robot, PROBLEM | {"joints": [name], "start": [0], "goal": [0]})


@settings(max_examples=60)
@given(
    entry=st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from([*PROBLEM, *BALL]), inner, max_size=6)
        ),
        max_leaves=12,
    ),
    key=st.sampled_from([*PROBLEM, *BALL]),
)
def test_any_entry_is_read_or_is_one_line(robot, entry, key):
    changed = PROBLEM | {"obstacles": [BALL | {key: entry}]} if key in BALL else PROBLEM | {key: entry}
    for given_entry in (changed, entry):
        try:
            read(robot, given_entry)
        except InputError as error:
            assert "\n" not in str(error)


def test_a_quaternion_of_few_digits_becomes_one(robot):
    (problem,) = read(robot, PROBLEM | {"obstacles": [BALL | {"quat_xyzw": [0.18, 0.37, 0.55, 0.73]}]})
    R = problem.obstacles[0].X_WO[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)


def test_beyond_the_limits(robot):
    assert said(robot, start=[0, 2.6]) == "start: bend 2.6 above its limit 2.5"
    assert said(robot, "goal", goal=[50.0, -2.25]) == "goal: bend -2.25 below its limit -2"
    assert said(robot, "goal", goal=[50.0, -2]) is None
    assert said(robot, start=[0, 2.500001]) is None, "rounding"


@settings(max_examples=30)
@given(
    depth=st.floats(0.001, 0.018), turn=st.floats(-3, 3), name=st.sampled_from(["ball", "base", "post", "obstacles"])
)
def test_the_depth_of_a_collision_is_said(robot, depth, turn, name):
    p = [0.3 * np.cos(turn), 0.3 * np.sin(turn), 0.5 + 0.02 + 0.1 - depth]
    (problem,) = read(robot, PROBLEM | {"goal": [turn, np.pi / 2], "obstacles": [BALL | {"id": name, "position": p}]})
    checker = problem_checker(robot, problem)
    ((link, other, found),) = collisions(checker, plant_positions(checker, problem.joints, problem.goal))
    assert (link, other) == ("forearm", name)
    assert found == pytest.approx(depth, abs=2e-4)
    assert refusal(checker, robot, problem, "goal").startswith(f"goal in collision: forearm with {name}, ")


def test_the_deepest_pairs_are_named(robot):
    balls = [
        BALL | {"id": f"ball_{i}", "position": [0.3, 0, 0.6 + 0.01 - 0.01 * i]} for i in range(5)
    ]  # by 1 mm, 1 cm, 2 cm ...
    reason = said(robot, start=[0, np.pi / 2], obstacles=balls)
    assert reason.startswith("start in collision: forearm with ball_4, 50 mm deep; forearm with ball_3, 40 mm deep; ")
    assert reason.endswith("; and 2 more")
    thin = BALL | {"position": [0.3, 0, 0.5 + 0.02 + 0.1 - 0.0035]}
    assert said(robot, start=[0, np.pi / 2], obstacles=[thin]) == "start in collision: forearm with ball, 3.5 mm deep"


def test_the_robot_with_itself(robot, tmp_path):
    assert said(robot, start=[0, 2.4]) is None
    deep = load_robot(
        write_urdf(tmp_path, ARM.replace('upper="2.5"', 'upper="3.1"').replace("0.2 0.2 0.2", "0.6 0.6 0.4"))
    )
    assert said(deep, start=[0, 3.0]).startswith("start in collision: base with forearm, ")


def test_what_the_base_stands_in(robot):
    floor = {"id": "floor", "type": "box", "dimensions": [4, 4, 0.1], "quat_xyzw": [0, 0, 0, 1]}
    assert said(robot, obstacles=[floor | {"position": [0, 0, -0.15 + STANDING / 2]}]) is None
    assert said(robot, obstacles=[floor | {"position": [0, 0, -0.15 + 0.03]}]) == (
        "start in collision: base with floor, 30 mm deep"
    )


def test_hundreds_of_problems_are_no_trouble(robot):
    rng = np.random.default_rng(0)
    crowd = [BALL | {"id": f"b{i}", "position": p} for i, p in enumerate((2 + rng.random((100, 3))).tolist())]
    (problem,) = read(robot, PROBLEM | {"obstacles": crowd})
    before = time.process_time()
    checker = problem_checker(robot, problem)
    assert time.process_time() - before < 1.0, "usually some .07 s"
    assert refusal(checker, robot, problem, "start") is None
