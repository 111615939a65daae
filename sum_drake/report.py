"""A run as one HTML page that opens without a network."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sum_drake import page
from sum_drake.assets import InputError, one_line
from sum_drake.belief import ENDS
from sum_drake.drawing import draw_depth, draw_perception, label_color, verdict
from sum_drake.explaining import explained
from sum_drake.faults import KINDS
from sum_drake.files import write_whole
from sum_drake.jsonio import encode
from sum_drake.making_way import MOVE
from sum_drake.runlog_reader import RunRecord, read_what_there_is
from sum_drake.summary_schema import validate_summary
from sum_drake.types import Attempt, Perception, SceneBelief
from sum_drake.yamlio import parse_yaml

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue


def write_report(run_folder: Path, catalogue: "Catalogue | None" = None) -> Path:
    """Writes `report.html` into a run folder, from whatever of summary and log there is; returns its path.

    Args:
        catalogue: the objects of the run; by default the ones that its scenario.yaml names.

    Raises InputError for a folder without anything to report.
    """
    from sum_drake.objects import load_catalogue

    run = _read_run(run_folder)
    if catalogue is None:
        try:
            catalogue = load_catalogue(_catalogue_path(run.scenario))
        except InputError as error:
            problem = f"Only objects of the package can be drawn: {error}"
            run, catalogue = dataclasses.replace(run, problems=(*run.problems, problem)), load_catalogue()
    path = run_folder / "report.html"
    write_whole(path, _page(run, catalogue))
    return path


@dataclasses.dataclass(frozen=True, eq=False)
class _Run:
    """What a run folder holds."""

    name: str
    summary: Mapping[str, Any] | None
    record: RunRecord | None
    scenario: str | None
    problems: tuple[str, ...]
    """What is missing or broken, one line each."""

    @property
    def perceptions(self) -> tuple[Perception, ...]:
        return () if self.record is None else self.record.perceptions

    @property
    def seed(self) -> str:
        if self.summary is not None:
            return str(self.summary["seed"])
        return "?" if self.record is None else self.record.metadata.get("seed", "?")

    def attempts(self) -> list[Mapping[str, Any]]:
        """Rows as in summary.json; without an outcome where there is no summary."""
        if self.summary is not None:
            return list(self.summary["attempts"])
        return [] if self.record is None else [_row(attempt) for _, attempt in self.record.attempts]


def _row(attempt: Attempt) -> Mapping[str, Any]:
    return {**encode(attempt), "rejected_by": dict(attempt.rejected_by), "outcome": None, "slip_m": None}


def _read_run(folder: Path) -> _Run:
    problems, summary, record, scenario = [], None, None, None
    try:
        data = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        validate_summary(data)
        summary = data
    except FileNotFoundError:
        problems.append("There is no summary.json: the run did not finish, so nothing is known of the truth.")
    except (OSError, ValueError) as error:
        problems.append(f"summary.json cannot be used: {one_line(error)}")
    try:
        record = read_what_there_is(folder / "run.mcap")
        if record.problem is not None:
            problems.append(f"Read as far as it goes: {record.problem}")
    except InputError as error:
        problems.append(str(error))
    if summary is None and record is None:
        raise InputError(f"{folder}: nothing to report; expected a run folder with summary.json or run.mcap")
    if (folder / "scenario.yaml").is_file():
        scenario = (folder / "scenario.yaml").read_text(encoding="utf-8", errors="replace")
    here = f"{folder}/"  # A report is passed on: it need not tell where the folder lay.
    return _Run(folder.resolve().name, summary, record, scenario, tuple(p.replace(here, "") for p in problems))


def _catalogue_path(scenario: str | None) -> Path | None:
    """The catalogue that a resolved scenario names; None where it names none, as for the package's."""
    try:
        data = parse_yaml(scenario or "", "scenario.yaml")
    except InputError:
        return None
    resolved = data.get("resolved") if isinstance(data, dict) else None
    named = resolved.get("catalogue") if isinstance(resolved, dict) else None
    return Path(named) if isinstance(named, str) and named else None


def _page(run: _Run, catalogue: "Catalogue") -> str:
    attempts = run.attempts()
    parts = [_header(run), *(f'<p class="problem">{page.text(problem)}</p>' for problem in run.problems)]
    if run.summary is not None:
        parts += [_figures(run.summary), "<h2>Objects</h2>", _object_table(run.summary["objects"], catalogue)]
    if run.summary is not None and run.summary.get("faults"):
        parts += ["<h2>Faults</h2>", _fault_table(run.summary["faults"], catalogue)]
    if attempts:
        parts += ["<h2>Attempts</h2>", _attempt_table(attempts, catalogue)]
    if run.perceptions:
        parts += ["<h2>Observations</h2>", _LEGEND]
        scored = {} if run.summary is None else {row["step"]: row for row in run.summary["observations"]}
        parts += [
            _observation(one, scored.get(one.step), _done_next(run, one.step, attempts), catalogue)
            for one in run.perceptions
        ]
    if run.summary is not None:
        parts += ["<h2>Costs</h2>", _timing(run.summary["timing"]), "<h2>Made with</h2>", _made_with(run.summary)]
    if run.scenario is not None:
        parts.append(f"<details><summary>Scenario</summary><pre>{page.text(run.scenario)}</pre></details>")
    return page.page(f"Sorting run {run.name}", parts)


def _header(run: _Run) -> str:
    outcome = "unfinished" if run.summary is None else run.summary["outcome"]
    kind = {"cleared": "good", "unfinished": "poor"}.get(outcome, "bad")
    return f"<h1>Sorting run, seed {page.text(run.seed)}</h1><p>{page.chip(outcome, kind)}</p>"


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
        ("simulated", _seconds(summary["timing"]["sim_time_s"])),
        ("took", _seconds(summary["timing"]["wall_s"])),
    ]
    return page.tiles(figures)


def _object_table(objects: Sequence[Mapping[str, Any]], catalogue: "Catalogue") -> str:
    rows = []
    for row in objects:
        kind = "good" if row["place"] == row["goal"] else "plain" if row["goal"] == "leave" else "bad"
        rows.append([_name(row["label"], catalogue), page.text(row["goal"]), page.chip(row["place"], kind)])
    return page.table(["object", "belongs in", "ended"], rows) if rows else "<p>There was none.</p>"


def _fault_table(faults: Sequence[Mapping[str, Any]], catalogue: "Catalogue") -> str:
    rows = []
    for row in faults:
        after = row["dealt_with_after"]
        looks = "" if after is None else _count(after, "look")
        kind = "plain" if not row["happened"] else "bad" if after is None else "good"
        rows.append(
            [
                str(row["observation"]),
                page.text(row["kind"].replace("_", " ")),
                page.text(KINDS.get(row["kind"], "")),
                "" if row["object"] is None else _name(row["object"], catalogue),
                looks,
                page.chip(row["belief"], kind),
            ]
        )
    return page.table(["look", "fault", "what happens", "object", "dealt with after", "what the belief says"], rows)


_OUTCOME_KINDS = {"sorted": "good", "moved": "good", "infeasible": "plain", None: "plain"}


def _attempt_table(attempts: Sequence[Mapping[str, Any]], catalogue: "Catalogue") -> str:
    rows = []
    for row in attempts:
        taken = row.get("object")
        mistaken = f" (was {taken})" if taken not in (None, row["label"]) else ""
        knocked = "".join(f"; knocked off {label}" for label in row.get("knocked_off", ()))
        rows.append(
            [
                str(row["step"]),
                _name(row["label"], catalogue) + page.text(mistaken),
                page.text(row["region"]),
                page.chip(row["outcome"] or "unknown", _OUTCOME_KINDS.get(row["outcome"], "bad")),
                page.text(_reason(row) + knocked),
                page.text(row.get("why", "")),
                page.text(_believed(row.get("believed"))),
                page.text(explained(row["grasp_candidates"], tuple(row["rejected_by"].items()))),
                _millimetres(row["slip_m"]),
            ]
        )
    heads = ["after look", "object", "to", "outcome", "reason", "why this", "believed afterwards", "grasps", "slip"]
    return page.table(heads, rows)


def _reason(row: Mapping[str, Any]) -> str:
    """How an attempt ended by what the robot knows, and, of one that was more than a pick and place, what it was."""
    words = str(row["reason"]).replace("_", " ")
    return f"moved out of the way: {words}" if row["kind"] == MOVE else words


def _believed(outcomes: Mapping[str, float] | None) -> str:
    """What the belief made of an attempt: its likeliest outcomes."""
    likely = sorted((outcomes or {}).items(), key=lambda item: -item[1])
    return ", ".join(f"{name} {share:.2f}" for name, share in likely[:2] if share >= 0.05)


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
    counts = [_count(len(perception.detections), "detection"), _count(len(tracks), "track"), f"{accepted} accepted"]
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


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _done_next(run: _Run, step: int, attempts: Sequence[Mapping[str, Any]]) -> str:
    """What followed a look."""
    words = []
    for row in attempts:
        if row["step"] == step:
            how = row["outcome"] or "outcome unknown"
            words.append(f"{row['label']} to {row['region']}, {how} ({_reason(row)})")
    tried = "Then: " + "; ".join(words) + "." if words else ""
    cut_off = run.record is not None and run.summary is None and step == run.perceptions[-1].step
    under_way = _under_way(run.record) if run.record is not None and cut_off else ""
    return f"{tried} {under_way}".strip() or "Then nothing was attempted."


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
                _name(track.label, catalogue),
                page.chip(verdict(track, belief.observation), "good" if track.accepted else "plain"),
                f"{track.probability:.2f}",
                f"{track.p_box * track.p_label:.2f}",
                f"{track.likelihood:.2f}",
                _millimetres(pose.get("translation_error_m")),
                _degrees(pose.get("rotation_error_rad")),
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
    costs = [(name, value) for name, value in timing.items() if value is not None]
    longest = max((value for _, value in costs), default=0.0) or 1.0
    rows = [
        [
            page.text(_words(name)),
            f'<span class="bar" style="width:{70 * value / longest:.1f}%"></span>{_seconds(value)}',
        ]
        for name, value in costs
    ]
    return page.table(["of", "cost"], rows) if rows else "<p>Nothing was measured.</p>"


def _words(name: str) -> str:
    return {"wall_s": "wall clock", "sim_time_s": "simulated time"}.get(
        name, name.removesuffix("_cpu_s") + " (CPU)" if name.endswith("_cpu_s") else name
    )


def _made_with(summary: Mapping[str, Any]) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in summary["versions"].items())
    device, digest = page.text(summary["device"]), page.text(summary["digest"])
    return f'<p>{page.text(versions)}; on {device}.</p><p class="digest">Digest {digest}</p>'


def _name(label: str, catalogue: "Catalogue") -> str:
    r, g, b = label_color(label, catalogue)
    return f'<span class="name"><i style="background:rgb({r},{g},{b})"></i>{page.text(label)}</span>'


def _millimetres(value: float | None) -> str:
    return "" if value is None else f"{1000 * value:.1f} mm"


def _degrees(value: float | None) -> str:
    return "" if value is None else f"{np.degrees(value):.1f}°"


def _seconds(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.1f} s"
