"""Belief over time: a lane a track, filled where it was accepted, with the reason where it ends."""

import dataclasses
import xml.etree.ElementTree as ET

from run_folders import looks
from test_drawing import make_perception

from sum_drake.belief_chart import belief_chart, lanes, left_out, reasons
from sum_drake.drawing import label_color
from sum_drake.objects import load_catalogue

SVG = "{http://www.w3.org/2000/svg}"
CATALOGUE = load_catalogue()


def texts(svg: str) -> list[str]:
    return [text.text or "" for text in ET.fromstring(svg).iter(SVG + "text")]


def test_a_lane_follows_a_track_to_its_end() -> None:
    can, mug = lanes(looks(CATALOGUE))
    assert (can.label, [i for i, _ in can.states], can.likeliest) == ("soup_can", [0], 0.93)
    assert can.end is not None and can.end[0] == 1 and can.end[1].reason == "placed"
    assert [i for i, _ in mug.states] == [0, 1] and mug.end is None
    assert "the camera does not see" in reasons(looks(CATALOGUE))["placed"]


def test_accepted_and_rejected_are_told_apart_and_ends_are_named() -> None:
    svg = belief_chart(looks(CATALOGUE), CATALOGUE)
    said = texts(svg)
    assert {"look 0", "look 1", "soup_can", "mug", "0.93", "\N{MULTIPLICATION X} placed"} <= set(said)
    assert said.count("0.07") == 2
    boxes = [r for r in ET.fromstring(svg).iter(SVG + "rect") if r.get("fill") == "none"]
    dashed = [box.get("stroke-dasharray") is not None for box in boxes]
    assert dashed == [False, True, True]
    assert boxes[0].get("stroke") == "rgb({},{},{})".format(*label_color("soup_can", CATALOGUE))
    titles = [title.text for title in ET.fromstring(svg).iter(SVG + "title")]
    assert "mug, track 1, look 1: 0.070, rejected" in titles


def test_a_bar_is_as_high_as_its_track_is_probable() -> None:
    for share in (0.0, 0.25, 1.0):
        look = make_perception(0, CATALOGUE)
        track = dataclasses.replace(look.posterior.tracks[0], probability=share)
        sure = dataclasses.replace(track, id=1, probability=1.0)
        belief = dataclasses.replace(look.posterior, tracks=(dataclasses.replace(sure, id=0), track))
        look = dataclasses.replace(look, posterior=dataclasses.replace(belief, tracks=(sure,)))
        other = dataclasses.replace(
            look, posterior=dataclasses.replace(belief, tracks=(dataclasses.replace(track, id=1),))
        )
        root = ET.fromstring(belief_chart([look, other], CATALOGUE))
        heights = [float(r.get("height", 0)) for r in root.iter(SVG + "rect") if r.get("fill-opacity")]
        assert abs(heights[1] - share * heights[0]) < 0.1


def test_tracks_nobody_believed_in_are_counted_and_nothing_is_no_chart() -> None:
    look = make_perception(0, CATALOGUE)
    can, mug = look.posterior.tracks
    faint = dataclasses.replace(look.posterior, tracks=(can, dataclasses.replace(mug, probability=0.01)))
    shown = [dataclasses.replace(look, posterior=faint)]
    assert "mug" not in texts(belief_chart(shown, CATALOGUE)) and left_out(shown) == 1
    assert belief_chart([], CATALOGUE) == "" and left_out([]) == 0
    empty = dataclasses.replace(look.posterior, tracks=())
    assert belief_chart([dataclasses.replace(look, posterior=empty)], CATALOGUE) == ""


def test_a_label_that_the_catalogue_lacks_is_grey_and_escaped() -> None:
    look = make_perception(0, CATALOGUE)
    odd = dataclasses.replace(look.posterior.tracks[0], label="<stapler>")
    svg = belief_chart(
        [dataclasses.replace(look, posterior=dataclasses.replace(look.posterior, tracks=(odd,)))], CATALOGUE
    )
    assert "<stapler>" in texts(svg)
