"""What runs on unseen under something else: the hand is not put there."""

import dataclasses

import numpy as np
import pytest
from deciding import REGIONS, believe, make_attempting, see
from scenes import observe, standing

from sum_drake.explaining import UNEXPLAINED
from sum_drake.geometry import apply, rotation_from_vector, transform
from sum_drake.hidden import hidden_between
from sum_drake.objects import load_catalogue, sample_surface
from sum_drake.pick_phases import unexplained
from sum_drake.planning_scene import solid_of
from sum_drake.robot import VIEW
from sum_drake.standing import standing_points
from sum_drake.types import readonly

CATALOGUE = load_catalogue()
CAN = standing(CATALOGUE, "soup_can", 0.6, 0.0)


def lying(label, p_W, yaw):
    """Its long side across, turned about the vertical."""
    long = int(np.ptp(np.asarray(CATALOGUE[label].load_mesh().bounds), axis=0).argmax())
    along = np.eye(3)[long]
    axis = np.cross(along, [0.0, 1.0, 0.0])
    R = rotation_from_vector(axis * np.pi / 2) if np.linalg.norm(axis) > 0.5 else np.eye(3)
    return transform(rotation_from_vector(np.array([0.0, 0.0, yaw])) @ R, np.array(p_W))


@pytest.fixture(scope="module")
def behind():
    """A banana behind a can, of which both ends show: its pose, the frame, and what is observed of it."""
    X_WO = lying("banana", [0.66, 0.0, 0.73], 0.0)
    frame, _ = observe(CATALOGUE, {"soup_can": CAN, "banana": X_WO})
    points = standing_points(frame, REGIONS["table"], 0.012)
    return X_WO, frame, points[~near(points, "soup_can", CAN, 0.012)]


def near(points, label, X_WO, distance):
    surface = apply(X_WO, sample_surface(CATALOGUE[label], 3000, np.random.default_rng(0))[0])
    return np.linalg.norm(points[:, None] - surface[None], axis=-1).min(axis=1) < distance


def test_between_two_ends_that_show_the_middle_may_be(behind):
    X_WO, frame, seen = behind
    found = unexplained(hidden_between(frame, seen), [solid_of(CATALOGUE["soup_can"], CAN)], 0.012)
    assert len(found) > 5
    assert near(found, "banana", X_WO, 0.02).mean() > 0.8, "where the banana is"
    assert not near(found, "soup_can", CAN, 0.008).any(), "the can is there, nothing else"
    assert np.abs(found[:, 1]).max() < 0.05, "only behind the can"


def test_what_shows_as_a_whole_or_ends_behind_nothing_is_not_continued(behind):
    X_WO, frame, seen = behind
    assert len(hidden_between(frame, seen[seen[:, 1] > 0])) == 0, "one part alone"
    assert len(hidden_between(frame, seen[:0])) == 0
    alone, _ = observe(CATALOGUE, {"banana": X_WO})
    whole = standing_points(alone, REGIONS["table"], 0.012)
    gap = whole[np.abs(whole[:, 1]) > 0.03]
    assert len(hidden_between(alone, gap)) == 0, "between the ends the table shows, or what is explained"
    blind = dataclasses.replace(frame, depth=readonly(np.zeros_like(frame.depth)))
    assert len(hidden_between(blind, seen)) == 0


def test_the_hand_keeps_clear_of_where_something_may_run_on(behind):
    X_WO, _, _ = behind
    seen = see({"soup_can": CAN, "banana": X_WO}, [believe("soup_can", CAN)])
    attempting = make_attempting()
    now = attempting.now(seen, (), VIEW)
    assert len(now.hidden_W) > 5
    heights = np.linspace(0.72, 0.80, 9)
    beside = np.array([[0.6, y, z] for y in (-0.045, 0.045) for z in heights])
    met = [
        sum(count for body, count in attempting.prospect(it, now.believed[0]).ranked.rejected_by if UNEXPLAINED in body)
        for it in (now, dataclasses.replace(now, hidden_W=beside))
    ]
    assert met[1] > met[0] + 20
