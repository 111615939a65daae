"""Pairs that may touch: an SRDF's, and a URDF's collision filter groups."""

import pytest
from small_robots import ARM, write_srdf, write_urdf

from sum_drake.assets import InputError
from sum_drake.user_robot import load_robot

GROUPS = """<drake:collision_filter_group name="low"><drake:member link="base"/><drake:member link="post"/>
  <drake:ignored_collision_filter_group name="{}"/></drake:collision_filter_group>
  <drake:collision_filter_group name="high"><drake:member link="{}"/></drake:collision_filter_group>"""


@pytest.mark.parametrize(
    ("body", "pairs"),
    [
        ("", set()),
        ('<disable_collisions link1="post" link2="base"/>', {("base", "post")}),
        ('<disable_collisions link1="post" link2="post"/>', set()),
        ('<disable_default_collisions link="post"/>', {("base", "post"), ("forearm", "post")}),
        (
            '<disable_default_collisions link="post"/><enable_collisions link1="base" link2="post"/>',
            {("forearm", "post")},
        ),
        ('<group name="arm"><joint name="none"/></group><virtual_joint name="v" type="fixed"/>', set()),
    ],
)
def test_pairs_of_an_srdf(tmp_path, body, pairs):
    robot = load_robot(write_urdf(tmp_path), write_srdf(tmp_path, body))
    assert robot.disabled == pairs
    assert robot.notes == ()


def test_links_that_the_robot_lacks_are_one_note(tmp_path):
    """The SRDF published with VAMP's Fetch names five that its URDF lacks."""
    body = "".join(f'<disable_collisions link1="base" link2="{name}"/>' for name in ("bellows", "wheel", "forearm"))
    robot = load_robot(write_urdf(tmp_path), write_srdf(tmp_path, body))
    assert robot.disabled == {("base", "forearm")}
    (note,) = robot.notes
    assert "arm.srdf: names links that arm.urdf lacks: 'bellows', 'wheel'; expected its links" in note
    assert "\n" not in note


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('<disable_collisions link1="post"/>', "a disable_collisions has no link2; expected the name of a link"),
        ("<disable_default_collisions/>", "a disable_default_collisions has no link"),
        ("<disable", "expected an SRDF, which is XML"),
    ],
)
def test_srdfs_that_cannot_be_used(tmp_path, body, words):
    with pytest.raises(InputError, match=words) as caught:
        load_robot(write_urdf(tmp_path), write_srdf(tmp_path, body))
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="expected an SRDF"):
        load_robot(write_urdf(tmp_path), tmp_path / "none.srdf")


def test_collision_filter_groups_of_drake(tmp_path):
    def disabled(*words):
        return load_robot(write_urdf(tmp_path, ARM + GROUPS.format(*words))).disabled

    assert disabled("low", "forearm") == {("base", "post")}
    assert disabled("high", "forearm") == {("base", "forearm"), ("forearm", "post")}
    with pytest.raises(InputError, match="collision filter group 'high': there is no link 'nobody'"):
        disabled("high", "nobody")
