"""`sum-drake replay`: perception once more, on the pictures and actions of a finished run."""

import argparse
import contextlib
import json
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sum_drake.assets import InputError
from sum_drake.commands.common import (
    Commands,
    Counting,
    add_command,
    add_parallel,
    add_quiet,
    anew_if_interrupted,
    check_count,
    check_writable,
)

if TYPE_CHECKING:
    from sum_drake.objects import Catalogue
    from sum_drake.replay import ObservationComparison
    from sum_drake.runlog_reader import RunRecord
    from sum_drake.systems.scenario import Scenario
    from sum_drake.types import Perception

SCHEMA = "sum-drake/replay/1"


def add(commands: Commands) -> None:
    """Declares the command."""
    text = "re-run perception on a run's pictures and actions, and compare beliefs with its log"
    replay = add_command(commands, "replay", _replay, text, "replay runs/3 --filter paper")
    replay.description = (
        "Re-run detector, association and belief on the pictures and actions in a run's log, without physics, and"
        " compare what is believed with the log. The exit code is 0 where all is identical, as it is with the same"
        " versions on the same machine, and 1 where the run did not repeat; with --filter or --scenario-text, which ask"
        " what another estimator would have believed, it is 0 whatever differs. 2: bad input."
    )
    replay.add_argument("run", type=Path, metavar="RUN", help="run folder")
    replay.add_argument("--filter", metavar="NAME", help="estimate poses by default, or paper: the filter as published")
    replay.add_argument("--scenario-text", metavar="YAML", help="fields that go over the run's scenario")
    replay.add_argument("--out", type=Path, metavar="FILE", help="write the comparison as JSON, too")
    replay.add_argument("--force", action="store_true", help="replace the file that is there")
    add_parallel(replay, "--workers", "processes that estimate poses")
    add_quiet(replay)


def _replay(options: argparse.Namespace) -> None:
    from sum_drake.doctor import require_rendering, versions
    from sum_drake.filter_config import filter_config
    from sum_drake.jsonio import write_json
    from sum_drake.replay import difference_table, summary, verdict
    from sum_drake.systems.scenario import catalogue_of, load_scenario
    from sum_drake.yamlio import parse_yaml

    logging.getLogger("drake").setLevel(logging.WARNING)  # pydrake has set it on import
    check_count("--workers", options.workers)
    if options.filter is not None:
        filter_config(options.filter)
    if options.out is not None:
        check_writable(options.out)
        if options.out.exists() and not options.force:
            raise InputError(f"--out {options.out}: exists; expected a new file, or --force to replace it")
    run = options.run
    if not run.is_dir():
        what = "a file" if run.exists() else "no such folder"
        raise InputError(f"{run}: {what}; expected the folder of a run, as sum-drake sort writes it")
    if not (run / "scenario.yaml").is_file():
        kind = "the folder of a batch" if (run / "batch.json").is_file() else "no scenario.yaml in it"
        raise InputError(f"{run}: {kind}; expected the folder of a run, as sum-drake sort writes it")
    scenario = load_scenario(run / "scenario.yaml", text=options.scenario_text)
    overrides = parse_yaml(options.scenario_text or "{}", "--scenario-text")
    if "faults" in overrides:
        raise InputError("--scenario-text: faults: what went wrong is in the run's log; expected other fields")
    if options.filter is not None and "filter" in overrides:
        raise InputError(f"--filter {options.filter}: --scenario-text names a filter, too; expected one of the two")
    if options.filter is not None:
        scenario.filter = options.filter
    catalogue = catalogue_of(scenario)
    record = _read(run, None if "random_seed" in overrides else scenario.random_seed, catalogue)
    require_rendering()
    notes = [*_notes(record, scenario), *_made_elsewhere(run)]
    with anew_if_interrupted(options.out, quiet=options.quiet):
        comparisons = _compared(record.perceptions, scenario, catalogue, options)
    if options.out is not None:
        about = {
            "schema": SCHEMA,
            "seed": scenario.random_seed,
            "filter": scenario.filter,
            "overrides": {"filter": options.filter, "scenario_text": options.scenario_text},
            "log_is_whole": record.problem is None,
            "notes": notes,
            "versions": versions(),
        }
        write_json(options.out, summary(comparisons, about))
    for note in notes:
        print(note)
    identical = all(one.identical for one in comparisons)
    said = verdict(comparisons, whole=record.problem is None)
    if not identical:
        print(difference_table(comparisons))
        if options.filter is None and options.scenario_text is None:
            raise RuntimeError(f"the run did not repeat: {said}")
    print(said)


def _read(run: Path, seed: int | None, catalogue: "Catalogue") -> "RunRecord":
    """The run's log. Raises InputError for one that holds nothing to replay, or that is not of this seed, if any."""
    from sum_drake.runlog_reader import read_what_there_is

    path = run / "run.mcap"
    record = read_what_there_is(path)
    if not record.perceptions:
        cut = "" if record.problem is None else f", as far as it goes ({record.problem.split('; ')[0]})"
        raise InputError(f"{path}: holds no observation{cut}; expected at least one")
    logged = record.metadata.get("seed")
    if None not in (seed, logged) and logged != str(seed):
        raise InputError(f"{run}: the log is of seed {logged}, scenario.yaml of {seed}; expected files of one run")
    for perception in record.perceptions:
        named = [label for detection in perception.detections for label, _ in detection.p_labels]
        for label in (*named, *(track.label for track in perception.posterior.tracks)):
            if label not in catalogue:
                raise InputError(
                    f"{path}: speaks of '{label}', which is not in {catalogue.path}; expected the run's catalogue"
                )
    return record


def _compared(
    perceptions: "Sequence[Perception]",
    scenario: "Scenario",
    catalogue: "Catalogue",
    options: argparse.Namespace,
) -> "list[ObservationComparison]":
    """Each record of the log with its replay."""
    import numpy as np

    from sum_drake.association import associate_frame
    from sum_drake.costs import Costs
    from sum_drake.filter_config import filter_config
    from sum_drake.pose_workers import PoseWorkers
    from sum_drake.replay import compare, false_detections, replay
    from sum_drake.systems.sorting import bind_detector, bind_perception
    from sum_drake.types import Array, Associations, Detection, Detections, Frame, PickPlace, SceneBelief

    costs = Costs()
    detect = bind_detector(scenario, catalogue, costs) if scenario.detector == "ObjectDetector" else None

    def see(logged: "Perception") -> tuple[Detection, ...]:
        if detect is None:
            return logged.detections
        false = false_detections(scenario.faults, logged.step)
        injected = logged.detections[len(logged.detections) - false :]
        return (*detect(logged.frame.color, logged.frame.depth), *injected)

    def vertices(label: str) -> Array:
        return np.asarray(catalogue[label].load_mesh().vertices)

    def associate(held: SceneBelief, frame: Frame, detections: Detections, action: PickPlace | None) -> Associations:
        return associate_frame(held, frame, detections, action, vertices, scenario.association)

    tell, found = Counting(quiet=options.quiet), []
    with contextlib.ExitStack() as stack:
        estimator = None
        if options.workers > 1:
            config = filter_config(scenario.filter)
            estimator = PoseWorkers(catalogue, config, options.workers, noise=scenario.depth_noise)
            stack.enter_context(estimator)
        update = bind_perception(scenario, catalogue, costs, estimator)
        tell("replaying observations", 0, len(perceptions))
        replayed = replay(perceptions, see, associate, update)
        for number, (logged, one) in enumerate(zip(perceptions, replayed, strict=True), start=1):
            found.append(compare(logged, one, catalogue))
            tell("replaying observations", number, len(perceptions))
    return found


def _notes(record: "RunRecord", scenario: "Scenario") -> list[str]:
    """What was not done as in a run, a line each."""
    from sum_drake.replay import false_detections

    notes = []
    if record.problem is not None:
        notes.append(f"replayed as far as it goes: {record.problem}")
    if scenario.detector != "ObjectDetector":
        notes.append(f"detections are taken as recorded: {scenario.detector} needs the simulator")
        return notes
    injected = [str(one.step) for one in record.perceptions if false_detections(scenario.faults, one.step)]
    if injected:
        notes.append(f"false detections, of a fault, are taken as recorded: observations {', '.join(injected)}")
    return notes


def _made_elsewhere(run: Path) -> list[str]:
    """Where summary.json tells of other versions, or of another machine, than here: one line."""
    from sum_drake.doctor import device, versions

    try:
        made = json.loads((run / "summary.json").read_text(encoding="utf-8"))
        then = {**made["versions"], "device": made["device"]}
    except (OSError, ValueError, KeyError, TypeError):  # a run that did not finish has none
        return []
    here = versions() | {"device": device()}
    other = [f"{name} {then[name]} (here {here[name]})" for name in here if then.get(name, here[name]) != here[name]]
    return [f"the run was made with {', '.join(other)}"] if other else []
