"""What a batch's folder holds, read back: what is damaged is refused, with what it is and what to do."""

import json

import pytest
from test_batch_report import LIMITS, row, write_batch

from sum_drake.assets import InputError
from sum_drake.batch_folder import made_by, read_batch, read_episode, read_episodes
from sum_drake.episodes import SCHEMA
from sum_drake.jsonio import write_json

ATTEMPT = {
    "step": 0, "track": 1, "label": "mug", "object": "mug", "region": "bin", "kind": "sort", "outcome": "sorted",
    "reason": "", "knocked_off": [], "grasp_candidates": 3, "rejected_by": {"reach": 1}, "slip_m": None,
}  # fmt: skip
EPISODE = row(5, 1, total=1) | {"schema": SCHEMA, "attempts": [ATTEMPT], "versions": {"drake": "1.0"}, "device": "a"}


def less(*names):
    return {key: value for key, value in EPISODE.items() if key not in names}


@pytest.fixture
def folder(tmp_path):
    """A batch of one run."""
    out = write_batch(tmp_path / "out", [row(5, 1, total=1)], seeds=[5, 5])
    (out / "5").mkdir()
    write_json(out / "5" / "episode.json", EPISODE)
    return out


def test_what_was_written_is_read(folder):
    assert read_episode(folder / "5") == EPISODE and read_episode(folder / "6") is None
    assert read_episodes(folder) == [EPISODE | {"objects_asked": 5}]
    assert [one["objects_asked"] for one in read_batch(folder)["episodes"]] == [5]
    assert (made_by(folder)["seeds"], made_by(folder)["device"]) == ([5, 5], "a machine")


def test_a_run_that_died_has_no_summary_and_is_read(folder):
    died = less("objects_total", "objects_sorted", "attempts", "objects", "digest", "limits", "timing")
    write_json(folder / "5" / "episode.json", died | {"state": "timed_out"})
    assert read_episodes(folder)[0]["state"] == "timed_out"


@pytest.mark.parametrize(
    ("damaged", "said"),
    [
        ("{", "no JSON"),
        ("null", "episode: NoneType; expected an object"),
        ("[1]", "episode: list; expected an object"),
        ({}, "episode.schema: missing; expected str"),
        ({"schema": SCHEMA}, "episode.seed: missing"),
        (EPISODE | {"schema": "other/1"}, "episode.schema: 'other/1'; expected 'sum-drake/episode/1'"),
        (EPISODE | {"seed": 6}, "episode.seed: 6; expected 5, as the folder"),
        (EPISODE | {"state": "won"}, "episode.state: 'won'; expected one of ended, failed"),
        (EPISODE | {"objects_sorted": 2}, "episode.objects_sorted: 2; expected 0 to 1"),
        (EPISODE | {"objects_sorted": -1}, "episode.objects_sorted: -1; expected 0 to 1"),
        (EPISODE | {"manipulation_trials": -1}, "episode.manipulation_trials: -1; expected 0 or more"),
        (EPISODE | {"cpu_s": -1.0}, "episode.cpu_s: -1.0; expected 0 or more"),
        (EPISODE | {"digest": 7}, "episode.digest: 7; expected str"),
        (EPISODE | {"versions": "new"}, "episode.versions: str; expected an object"),
        (EPISODE | {"attempts": [ATTEMPT | {"outcome": "won"}]}, "episode.attempts[0].outcome: 'won'; expected one of"),
        (EPISODE | {"limits": {"samples": 3}}, "episode.limits.position_use: missing"),
        (EPISODE | {"limits": 3}, "episode.limits: int"),
        (EPISODE | {"faults": [{"kind": "taken"}]}, "episode.faults[0].observation: missing"),
        (less("attempts"), "episode.attempts: missing"),
        (less("timing"), "episode.timing: missing"),
    ],
)
def test_a_damaged_episode_is_told_and_how_to_run_it_again(damaged, said, folder):
    file = folder / "5" / "episode.json"
    file.write_text(damaged if isinstance(damaged, str) else json.dumps(damaged))
    with pytest.raises(InputError) as refusal:
        read_episode(folder / "5")
    told = str(refusal.value)
    assert told.startswith(f"{file}: {said}") and told.endswith(f": remove {folder / '5'} to run it again")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"schema": "sum-drake/batch/9"}, "batch.schema: 'sum-drake/batch/9'; expected 'sum-drake/batch/1'"),
        ({"episodes": [1]}, "batch.episodes[0]: int; expected an object"),
        ({"episodes": [{"seed": 5}]}, "batch.episodes[0].state: missing"),
        ({"episodes": [row(5, 1) | {"timing": {}}]}, "batch.episodes[0].timing.perception_cpu_s: missing"),
        ({"episodes": [row(5, 1) | {"limits": LIMITS | {"samples": "many"}}]}, "batch.episodes[0].limits.samples"),
        ({"episodes": [row(5, 9)]}, "batch.episodes[0].objects_sorted: 9; expected 0 to 5"),
        ({"settings": {}}, "batch.settings.objects: missing"),
        ({"seeds": []}, "batch.seeds: []; expected a first and a last one"),
        ({"losses": [1]}, "batch.losses[0]: int"),
        ({"figures": {"runs": "many"}}, "batch.figures.runs: 'many'"),
        ({"commit": 3}, "batch.commit: 3"),
        ({"errors": {"slipped": "often"}}, "batch.errors.slipped: 'often'"),
    ],
)  # fmt: skip
def test_a_damaged_batch_is_told_and_what_to_do(change, said, folder):
    file = folder / "batch.json"
    whole = json.loads(file.read_text())
    file.write_text(json.dumps(whole | change))
    with pytest.raises(InputError) as refusal:
        read_batch(folder)
    told = str(refusal.value)
    assert told.startswith(f"{file}: {said}") and "restore it, or take another folder" in told
    file.write_text("null")
    with pytest.raises(InputError, match="batch: NoneType; expected an object"):
        read_batch(folder)
