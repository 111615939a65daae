"""A run as one HTML page that opens without a network."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from sum_drake import page
from sum_drake.assets import InputError
from sum_drake.belief import ENDS
from sum_drake.belief_chart import SHOWN, belief_chart, left_out, reasons
from sum_drake.drawing import Image, draw_depth, draw_perception, verdict
from sum_drake.faults import KINDS
from sum_drake.files import write_whole
from sum_drake.from_above import above_legend, from_above
from sum_drake.report_attempts import attempts_part
from sum_drake.report_parts import (
    cost_name,
    count,
    degrees,
    millimetres,
    name,
    outcome_chip,
    place_chip,
    reason,
    seconds,
)
from sum_drake.run_folder import RunFolder, Tried, catalogue_of_run, read_run_folder
from sum_drake.runlog_reader import RunRecord
from sum_drake.types import Perception, SceneBelief

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue

Progress = Callable[[int, int], None]
"""Told how many pictures of the film are done, of how many."""


def write_report(
    run_folder: Path,
    catalogue: "Catalogue | None" = None,
    *,
    out: Path | None = None,
    film: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Writes a run's report, from whatever of summary and log there is; returns its path.

    Args:
        catalogue: the objects of the run; by default the ones that its scenario.yaml names.
        out: the file; by default `report.html` in the run folder.
        film: render a film, too.
        progress: of the film.

    Raises InputError for a folder without anything to report.
    """
    run = read_run_folder(run_folder)
    if catalogue is None:
        catalogue, problem = catalogue_of_run(run)
        if problem is not None:
            run = dataclasses.replace(run, problems=(*run.problems, problem))
    path = run_folder / "report.html" if out is None else out
    write_whole(path, _page(run, catalogue, _film(run, catalogue, progress) if film else _NO_FILM))
    return path


_NO_FILM = '<p class="legend">A film of the run comes with <code>sum-drake report RUN --force</code>.</p>'


def _film(run: RunFolder, catalogue: "Catalogue", progress: Progress | None) -> str:
    """The film, or why there is none, HTML."""
    from sum_drake.doctor import egl_problem
    from sum_drake.storyboard import storyboard

    board = None if run.record is None else storyboard(run.record, catalogue, run.regions())
    if run.record is None or board is None or not board.shots:
        lack = "no log" if run.record is None else "nothing of joints in the log"
        return f'<p class="problem">There is no film: there is {lack}.</p>'
    problem = egl_problem()
    if problem is not None:
        return f'<p class="problem">There is no film: {page.text(problem)}</p>'
    from sum_drake.film import FPS, SCENE, film, webm

    joint_names = run.record.joint_names
    directives = run.resolved().get("directives")
    scene = yaml.safe_dump({"directives": directives}) if directives else SCENE
    poster: list[Image] = []

    def with_poster() -> Iterator[Image]:
        """The pictures one by one, so that one alone is in memory; that of the middle is kept."""
        for i, image in enumerate(film(board, catalogue, joint_names, directives=scene, progress=progress)):
            if i == len(board.shots) // 2:
                poster.append(image)
            yield image

    try:
        data = webm(with_poster())
    except (InputError, RuntimeError) as error:
        return f'<p class="problem">There is no film: {page.text(str(error))}</p>'
    said = (
        f"{board.speed:.1f} times as fast as it was; rendered from the log: the robot as its joints were measured, "
        "things where they were believed to be."
    )
    shown = page.video(data, poster[0], "The run as a film")
    return f'{shown}<p class="legend">{said} {len(board.shots) / FPS:.0f} s.</p>'


def _page(run: RunFolder, catalogue: "Catalogue", film: str) -> str:
    tried = run.tried()
    parts = [_header(run), *(f'<p class="problem">{page.text(problem)}</p>' for problem in run.problems)]
    if run.summary is not None:
        parts += [_figures(run.summary)]
    parts += _scene(run, catalogue, film)
    if run.summary is not None:
        parts += ["<h2>Objects</h2>", _object_table(run.summary["objects"], catalogue)]
    if run.summary is not None and run.summary.get("faults"):
        parts += ["<h2>Faults</h2>", _fault_table(run.summary["faults"], catalogue)]
    parts += attempts_part(tried, catalogue)
    parts += _belief(run.perceptions, catalogue)
    if run.perceptions:
        parts += ["<h2>Observations</h2>", _LEGEND]
        scored = {} if run.summary is None else {row["step"]: row for row in run.summary["observations"]}
        parts += [
            _observation(one, scored.get(one.step), _done_next(run, one.step, tried), catalogue)
            for one in run.perceptions
        ]
    if run.summary is not None:
        parts += ["<h2>Costs</h2>", _timing(run.summary["timing"]), "<h2>Made with</h2>", _made_with(run.summary)]
    if run.scenario is not None:
        parts.append(f"<details><summary>Scenario</summary><pre>{page.text(run.scenario)}</pre></details>")
    return page.page(f"Sorting run {run.name}", parts)


def _scene(run: RunFolder, catalogue: "Catalogue", film: str) -> list[str]:
    """The film and the table from above, side by side; HTML."""
    above = from_above(run, catalogue)
    filmed = [] if film is _NO_FILM else [f"<div><h2>The run</h2>{film}</div>"]
    seen = [f"<div><h2>From above, at the end</h2>{page.figure(above)}{above_legend(run)}</div>"] if above else []
    none = [] if above or run.record is None else ["<p>The log holds no look: nothing is believed.</p>"]
    side_by_side = ['<div class="scene">', *filmed, *seen, "</div>"] if filmed or seen else []
    return [*none, *side_by_side, *([film] if film is _NO_FILM else [])]


def _belief(looks: Sequence[Perception], catalogue: "Catalogue") -> list[str]:
    """What became of each track; HTML."""
    chart = belief_chart(looks, catalogue)
    if not chart:
        return []
    words = (
        "A row a track, a box a look, filled as far as the track is probable: in colour where it was accepted, pale "
        "and dashed where it was rejected or not seen."
    )
    rest = left_out(looks)
    if rest:
        words += f" Not shown: {count(rest, 'track')} never above {SHOWN:g}."
    ends = [f"<b>{page.text(word)}</b>: {page.text(said)}" for word, said in reasons(looks).items()]
    told = f" Ended, {'; '.join(ends)}." if ends else ""
    return ["<h2>Belief over time</h2>", f'<p class="legend">{page.text(words)}{told}</p>', page.figure(chart)]


def _header(run: RunFolder) -> str:
    return f"<h1>Sorting run, seed {page.text(run.seed)}</h1><p>{outcome_chip(run.outcome, run.summary)}</p>"


def _figures(summary: Mapping[str, Any]) -> str:
    blame = summary["missorted_by"]
    missorted = str(summary["objects_missorted"])
    if summary["objects_missorted"]:
        missorted += f" ({blame['perception']} perception, {blame['manipulation']} manipulation)"
    figures = [
        ("objects sorted", f"{summary['objects_sorted']} of {summary['objects_total']}"),
        ("missorted", missorted),
        ("trials", str(summary["manipulation_trials"])),
        ("manipulation errors", str(summary["manipulation_errors"])),
        ("simulated", seconds(summary["timing"]["sim_time_s"])),
        ("took", seconds(summary["timing"]["wall_s"])),
    ]
    return page.tiles(figures)


def _object_table(objects: Sequence[Mapping[str, Any]], catalogue: "Catalogue") -> str:
    rows = []
    for row in objects:
        rows.append([name(row["label"], catalogue), page.text(row["goal"]), place_chip(row)])
    return page.table(["object", "belongs in", "ended"], rows) if rows else "<p>There was none.</p>"


def _fault_table(faults: Sequence[Mapping[str, Any]], catalogue: "Catalogue") -> str:
    rows = []
    for row in faults:
        after = row["dealt_with_after"]
        looks = "" if after is None else count(after, "look")
        kind = "plain" if not row["happened"] else "bad" if after is None else "good"
        rows.append(
            [
                str(row["observation"]),
                page.text(row["kind"].replace("_", " ")),
                page.text(KINDS.get(row["kind"], "")),
                "" if row["object"] is None else name(row["object"], catalogue),
                looks,
                page.chip(row["belief"], kind),
            ]
        )
    return page.table(["look", "fault", "what happens", "object", "dealt with after", "what the belief says"], rows)


_LEGEND = (
    '<p class="legend">Thin boxes are detections. Filled outlines with axes are tracks that were accepted, dashed '
    "outlines tracks that were rejected or not seen, each with the probability that it is right. Errors are "
    "against the truth, which the robot does not know.</p>"
)


def _observation(
    perception: Perception,
    score: Mapping[str, Any] | None,
    done_next: str,
    catalogue: "Catalogue",
) -> str:
    picture = page.picture(draw_perception(perception, catalogue), "Picture with detections and tracks")
    depth = page.picture(draw_depth(perception.frame.depth), "Depth")
    return (
        f"<section><h3>Look {perception.step} <small>at {perception.frame.time:.1f} s</small></h3>"
        f"<p>{page.text(_observed(perception, score))}</p>"
        f'<div class="pictures">{picture}{depth}</div>'
        f"{_track_table(perception.posterior, score, catalogue)}"
        f"{_ended(perception.posterior)}"
        f"<p>{page.text(done_next)}</p></section>"
    )


def _ended(belief: SceneBelief) -> str:
    """The tracks that a look ended, and why."""
    words = [f"track {gone.track}, {gone.label}: {ENDS.get(gone.reason, gone.reason)}" for gone in belief.gone]
    return f"<p>Ended: {page.text('; '.join(words))}.</p>" if words else ""


def _observed(perception: Perception, score: Mapping[str, Any] | None) -> str:
    tracks = perception.posterior.tracks
    accepted = sum(track.accepted for track in tracks)
    counts = [count(len(perception.detections), "detection"), count(len(tracks), "track"), f"{accepted} accepted"]
    words = [", ".join(counts)]
    if score is not None and score["false_positives"] is not None:
        words.append(f"{score['false_positives_rejected']} of {score['false_positives']} false positives rejected")
        words.append(f"{score['true_tracks_accepted']} of {score['true_tracks']} true tracks accepted")
    if score is not None and score.get("false_detections"):
        words.append(f"false detections: {', '.join(map(_fate, score['false_detections']))}")
    return "; ".join(words) + "."


def _fate(detection: Mapping[str, Any]) -> str:
    """A false detection and what became of it."""
    became = {"corrected": f"corrected to {detection['accepted_as']}", "accepted": "believed"}
    return f"{detection['label']} {detection['probability']:.2f} {became.get(detection['fate'], detection['fate'])}"


def _done_next(run: RunFolder, step: int, tried: Sequence[Tried]) -> str:
    """What followed a look."""
    words = []
    for row in (one.row for one in tried):
        if row["step"] == step:
            how = row["outcome"] or "outcome unknown"
            words.append(f"{row['label']} to {row['region']}, {how} ({reason(row)})")
    then = "Then: " + "; ".join(words) + "." if words else ""
    cut_off = run.record is not None and run.summary is None and step == run.perceptions[-1].step
    under_way = _under_way(run.record) if run.record is not None and cut_off else ""
    return f"{then} {under_way}".strip() or "Then nothing was attempted."


def _under_way(record: RunRecord) -> str:
    """What the robot was about when the log of a run that has no summary ends, after its last look."""
    look = record.perceptions[-1]
    events = [event for event in record.events if event["time"] >= look.frame.time]
    ended = [event["detail"]["outcome"] for event in events if event["name"] == "run_ended"]
    if ended:
        return f"Then the run ended: {ended[-1]}."
    times = [look.frame.time, *record.joint_times[-1:], *(event["time"] for event in events)]
    times += [time for time, _ in record.attempts]
    done = any(attempt.step == look.step and attempt.action is not None for _, attempt in record.attempts)
    begun = [event["detail"]["segment"] for event in events if event["name"] == "segment_begun"]
    doing = f"a pick and place was under way ({begun[-1]}) when " if begun and not done else ""
    return f"Then {doing}the log ends, at {max(times):.1f} s."


def _track_table(belief: SceneBelief, score: Mapping[str, Any] | None, catalogue: "Catalogue") -> str:
    poses = {} if score is None else {pose["track"]: pose for pose in score["poses"]}
    rows = []
    for track in sorted(belief.tracks, key=lambda track: -track.probability):
        pose = poses.get(track.id, {})
        share = pose.get("visible_share")
        rows.append(
            [
                str(track.id),
                name(track.label, catalogue),
                page.chip(verdict(track, belief.observation), "good" if track.accepted else "plain"),
                f"{track.probability:.2f}",
                f"{track.p_box * track.p_label:.2f}",
                f"{track.likelihood:.2f}",
                millimetres(pose.get("translation_error_m")),
                degrees(pose.get("rotation_error_rad")),
                "" if share is None else f"{100 * share:.0f} %",
            ]
        )
    if not rows:
        return ""
    heads = [
        "track",
        "label",
        "verdict",
        "probability",
        "detector",
        "likelihood",
        "position error",
        "angle error",
        "visible",
    ]
    return page.table(heads, rows)


def _timing(timing: Mapping[str, float | None]) -> str:
    costs = [(of, value) for of, value in timing.items() if value is not None]
    longest = max((value for _, value in costs), default=0.0) or 1.0
    rows = [
        [
            page.text(cost_name(of)),
            f'<span class="bar" style="width:{70 * value / longest:.1f}%"></span>{seconds(value)}',
        ]
        for of, value in costs
    ]
    return page.table(["cost", "took"], rows) if rows else "<p>Nothing was measured.</p>"


def _made_with(summary: Mapping[str, Any]) -> str:
    versions = ", ".join(f"{of} {version}" for of, version in summary["versions"].items())
    device, digest = page.text(summary["device"]), page.text(summary["digest"])
    return f'<p>{page.text(versions)}; on {device}.</p><p class="digest">Digest {digest}</p>'
