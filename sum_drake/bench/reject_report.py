"""report.html of `sum-drake bench reject`: figures, the plots behind them, and what was believed of what went wrong."""

from collections.abc import Mapping, Sequence

import numpy as np

from sum_drake import page
from sum_drake.action_model import OUTCOMES
from sum_drake.bench.aims import figure_table
from sum_drake.bench.hypotheses import FirstLook, Judged
from sum_drake.bench.reject_figures import AIMS, confusion, coverage_risk, recovered, said, stated
from sum_drake.bench.result_plots import telling_plot
from sum_drake.bench.sequences import FAULTS, Followed, Outcome
from sum_drake.plots import Series, line_plot

SHARE = (0.0, 1.0)
SIZE = (525, 330)


def report_page(
    looks: Sequence[FirstLook], trials: Sequence[FirstLook], followed: Sequence[Followed], found: Mapping[str, float]
) -> str:
    """The page, of what `reject_figures.figures` is made of."""
    judged = [one for look in looks for one in look.judged]
    after = [one for each in followed for one in each.judged if one.observation > 0]
    outcomes = [outcome for each in followed for outcome in each.outcomes]
    told = [name for name in AIMS if np.isfinite(found.get(name, np.nan))]
    parts = [
        "<h1>Is it really there?</h1>",
        f"<p>{len(judged)} hypotheses of one look at each of {len(looks)} poured tables that nothing was learned on: "
        "half seen by the trained detector, half by one that takes a quarter of the objects for something else; half "
        "with things that no label fits; half through a stereo camera; half from elsewhere than the robot's head; half "
        "estimated with meshes that are off. A hypothesis is right if an object of its label is within 2 cm and "
        "20 degrees of its pose. Rejected is what the belief does not accept.</p>",
        page.tiles([(name.replace("_", " "), _number(found[name])) for name in told]),
        figure_table(found, AIMS),
        "<h2>What tells right from wrong</h2>",
        f'<div class="plots">{_roc_plot(judged)}{_coverage_plot(looks)}</div>',
        "<h2>How far the stated probability can be trusted</h2>",
        f'<div class="plots">{_reliability_plot("After one look", judged)}'
        f"{_reliability_plot('After something happened', after)}</div>",
        "<h2>The paper's false positives</h2>",
        f"<p>{len({one.table for one in trials})} scenes of five objects, {len({one.trial for one in trials})} trials "
        "each, seen by the detector that takes a quarter of the objects for something else: the trained one hardly "
        "makes a mistake on such scenes. As the paper counts, a hypothesis is false if no object of its label is in "
        "its box. The paper reports .84 rejected, a standard error of .0126, and not how many true ones were kept.</p>",
        page.table(("scene", "false", "of them rejected", "true", "of them kept"), _trial_rows(trials)),
        "<h2>What happened between looks, and was found again or given up</h2>",
        page.table(
            ("what happened", "", "objects", "after the first look", "within two"),
            [_fault_row(name, [one for one in outcomes if one.fault == name]) for name in FAULTS],
        ),
        "<h2>Actions: what happened to the target, and what was believed after one look</h2>",
        page.table(("happened", *(f"believed {name}" for name in OUTCOMES)), _confusion_rows(outcomes)),
    ]
    missed = [one for one in outcomes if one.handled_after == 0]
    if missed:
        parts += [
            "<h2>Not found again, nor given up</h2>",
            page.table(
                ("table", "what happened", "object", "where it is"),
                [
                    (str(m.table), page.text(m.fault), page.text(m.label), "on the table" if m.on_table else "gone")
                    for m in missed
                ],
            ),
        ]
    return page.page("Is it really there?", parts)


def _roc_plot(judged: Sequence[Judged]) -> str:
    rows = [{"table": "hypothesis", "right": one.right, "said": said(one)} for one in judged]
    return telling_plot({"rows": rows})


def _coverage_plot(looks: Sequence[FirstLook]) -> str:
    coverage, risk = coverage_risk(looks)
    return line_plot(
        [Series("", coverage, risk)],
        title="What accepting more costs",
        x_label="share of visible objects accepted",
        y_label="share of accepted that is wrong",
        x_range=SHARE,
        size=SIZE,
    )


def _reliability_plot(title: str, judged: Sequence[Judged]) -> str:
    found = stated(judged)
    return line_plot(
        [Series("", SHARE, SHARE, dashed=True), Series("belief", found.stated, found.observed, dots=True)],
        title=title,
        x_label="stated probability",
        y_label="share that is right",
        x_range=SHARE,
        y_range=SHARE,
        size=SIZE,
    )


def _trial_rows(trials: Sequence[FirstLook]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for scene in dict.fromkeys(one.table for one in trials):
        of = [one.counted for one in trials if one.table == scene]
        false, true = sum(c.false_positives for c in of), sum(c.true_tracks for c in of)
        rejected, kept = sum(c.false_positives_rejected for c in of), sum(c.true_tracks_accepted for c in of)
        rows.append((str(scene), str(false), str(rejected), str(true), str(kept)))
    return rows


def _fault_row(name: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    about = (FAULTS[name].__doc__ or "").split("\n")[0]
    first = float(np.mean([one.handled_after == 1 for one in outcomes])) if outcomes else float("nan")
    return page.text(name), page.text(about), str(len(outcomes)), _number(first), _number(recovered(outcomes))


def _confusion_rows(outcomes: Sequence[Outcome]) -> list[list[str]]:
    counts = confusion(outcomes)
    return [
        [page.text(happened), *(str(counts.get((happened, believed), 0)) for believed in OUTCOMES)]
        for happened in OUTCOMES
    ]


def _number(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.3f}"
