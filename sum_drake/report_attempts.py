"""The part of a run's report that tells of its attempts: each with its grasp, and why."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from sum_drake import page
from sum_drake.drawing import draw_grasp
from sum_drake.explaining import explained
from sum_drake.report_parts import believed, millimetres, name, reason, tried_chip
from sum_drake.run_folder import Tried

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

LEGEND = (
    "The object's outline and the hand's boxes, fingers yellow and palm white, lie where they were believed and "
    "planned to be, on what the camera saw before. Outcomes and slip are by the truth, which the robot does not know."
)


def attempts_part(tried: Sequence[Tried], catalogue: "Catalogue") -> list[str]:
    """Cards of the attempts for which the arm set out, then a table of the others; HTML, nothing for none."""
    if not tried:
        return []
    set_out = [one for one in tried if one.number is not None]
    others = [one for one in tried if one.number is None]
    parts = ["<h2>Attempts</h2>"]
    if set_out:
        cards = "".join(_card(one, catalogue) for one in set_out)
        parts += [f'<p class="legend">{LEGEND}</p>', f'<div class="cards">{cards}</div>']
    if set_out and others:
        parts.append("<h3>Given up before the arm set out</h3>")
    if others:
        parts.append(_table(others, catalogue))
    return parts


def _card(one: Tried, catalogue: "Catalogue") -> str:
    row, action = one.row, one.attempt.action if one.attempt is not None else None
    picture = ""
    if action is not None and one.look is not None:
        drawn = draw_grasp(one.look, action, catalogue)
        picture = page.picture(drawn, f"The grasp at {row['label']} that was planned after look {row['step']}")
    facts = [
        ("to", page.text(row["region"])),
        ("ended", page.text(_ended(one))),
        ("believed", page.text(believed(row.get("believed")))),
        ("fingers", page.text(_felt(one))),
        ("slip", millimetres(row["slip_m"])),
    ]
    told = "".join(f"<dt>{words}</dt><dd>{fact}</dd>" for words, fact in facts if fact)
    reasons = [("Why this", str(row.get("why", ""))), ("Grasps", _grasps(one))]
    because = "".join(f"<p><b>{words}</b>: {page.text(said)}</p>" for words, said in reasons if said)
    return (
        f'<section class="attempt">{picture}<div><h3>{one.number}. {_object(one, catalogue)} '
        f"{tried_chip(row['outcome'])} <small>after look {row['step']}</small></h3><dl>{told}</dl></div>"
        f'<div class="because">{because}</div></section>'
    )


def _table(tried: Sequence[Tried], catalogue: "Catalogue") -> str:
    rows = [
        [
            str(one.row["step"]),
            _object(one, catalogue),
            page.text(one.row["region"]),
            tried_chip(one.row["outcome"]),
            page.text(_ended(one)),
            page.text(one.row.get("why", "")),
            page.text(believed(one.row.get("believed"))),
            page.text(_grasps(one)),
            millimetres(one.row["slip_m"]),
        ]
        for one in tried
    ]
    heads = ["after look", "object", "to", "outcome", "reason", "why this", "believed afterwards", "grasps", "slip"]
    return page.table(heads, rows)


def _object(one: Tried, catalogue: "Catalogue") -> str:
    """What was gone for, and what it was in truth where that is another."""
    taken, label = one.row.get("object"), one.row["label"]
    return name(label, catalogue) + (page.text(f" (was {taken})") if taken not in (None, label) else "")


def _ended(one: Tried) -> str:
    return reason(one.row) + "".join(f"; knocked off {label}" for label in one.row.get("knocked_off", ()))


def _grasps(one: Tried) -> str:
    return explained(one.row["grasp_candidates"], tuple(one.row["rejected_by"].items()))


def _felt(one: Tried) -> str:
    """What the fingers measured, by the robot alone."""
    action = one.attempt.action if one.attempt is not None else None
    if action is None:
        return ""
    said = f"{1000 * action.gap_lift:.0f} mm apart after the lift"
    return f"{said}, {1000 * action.gap_place:.0f} mm before letting go" if action.released else said
