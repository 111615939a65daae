"""Pages about batches."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from test_report import Page

from sum_drake.assets import InputError
from sum_drake.batch_figures import batch_figures, causes, errors, losses, paired_difference
from sum_drake.batch_folder import read_batch
from sum_drake.batch_report import write_batch_report
from sum_drake.cli import main
from sum_drake.jsonio import write_json

LIMITS = {
    "samples": 1000, "position_use": 0.9, "speed_use": 0.9, "acceleration_use": 0.9, "effort_use": 0.9,
    "violations": {"speed": 0},
}  # fmt: skip


def row(seed: int, done: int, *, total: int = 5) -> dict[str, Any]:
    objects = [
        {"label": f"thing{i}", "goal": "bin", "place": "bin" if i < done else "floor", "p_W": [0, 0, 0]}
        for i in range(total)
    ]
    attempts = [
        {"label": one["label"], "object": one["label"], "knocked_off": [], "reason": "empty_hand"}
        | {"outcome": "sorted" if one["place"] == "bin" else "dropped"}
        for one in objects
    ]
    return {
        "seed": seed, "state": "ended", "reason": "", "outcome": "cleared", "objects_total": total,
        "objects_sorted": done, "objects_missorted": 0, "manipulation_trials": total, "manipulation_errors": 0,
        "objects": objects, "attempts": attempts, "limits": LIMITS, "cpu_s": 100.0 + seed,
        "wall_s": 100.0, "peak_memory_mib": 700.0, "digest": f"{seed}-{done}",
        "timing": {"perception_cpu_s": 1.0, "planning_cpu_s": 2.0, "simulation_cpu_s": 3.0, "sim_time_s": 60.0},
    }  # fmt: skip


DIED = {"state": "crashed", "reason": "killed", "cpu_s": 3.0, "peak_memory_mib": 10.0, "objects_asked": 5}


def write_batch(folder: Path, rows: list[dict[str, Any]], **more: Any) -> Path:
    folder.mkdir()
    data = {
        "schema": "sum-drake/batch/1", "seeds": [0, 9],
        "settings": {"first_seed": 0, "objects": 5, "code": "a", "scenario": "b"},
        "runs": len(rows), "done": len(rows), "figures": batch_figures(rows), "causes": causes(rows),
        "losses": losses(rows), "errors": errors(rows), "episodes": rows,
        "versions": {"drake": "1.51.1"}, "device": "a machine",
    }  # fmt: skip
    write_json(folder / "batch.json", data | more)
    return folder


def test_a_benchs_folder_is_told_from_a_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("results.json", "report.html"):
        (tmp_path / name).write_text("{}")
    assert main(["report", str(tmp_path)]) == 2
    assert f"{tmp_path}: of a bench, whose page is {tmp_path / 'report.html'}" in capsys.readouterr().err


def words_of(*folders: Path) -> str:
    text = write_batch_report(folders, folders[0].parent / "page.html").read_text()
    assert "http" not in text and "<script" not in text
    return Page(text).words


def test_a_batch_tells_what_was_sorted_and_what_was_lost(tmp_path: Path) -> None:
    crashed = DIED | {"seed": 2, "reason": "killed by signal 9"}
    words = words_of(write_batch(tmp_path / "a", [row(0, 5), row(1, 4), crashed]))
    for part in ("Batch a", "3 runs, seeds 0 to 9", "5 of 5", "4 of 5", "thing4 (1)", "dropped: empty_hand", "crashed"):
        assert part in words, part
    assert "Manipulation errors cause trials dropped: empty_hand 1" in " ".join(words.split())
    assert "killed by signal 9" in words and "0.6" in words, "a run that died sorted none of its five"
    assert "5: any (2), any (2)" in words, "all of them are lost, to the crash"


def test_what_a_run_that_died_said_last_is_led_to(tmp_path: Path) -> None:
    folder = write_batch(tmp_path / "a", [row(0, 5), DIED | {"seed": 1}])
    for seed in "01":
        (folder / seed).mkdir()
    (folder / "1" / "log.txt").write_text("killed")
    html = write_batch_report([folder], folder / "report.html").read_text()
    assert '<a href="1/log.txt">what it said last</a>' in html and 'href="0/' not in html


def test_a_batch_of_before_errors_were_told_has_a_page(tmp_path: Path) -> None:
    folder = write_batch(tmp_path / "a", [row(0, 4)])
    told = json.loads((folder / "batch.json").read_text())
    del told["errors"]
    write_json(folder / "batch.json", told)
    words = words_of(folder)
    assert "dropped: empty_hand" in words and "Manipulation errors" not in words


def test_equal_batches_are_said_to_be_equal(tmp_path: Path) -> None:
    a, b = (write_batch(tmp_path / name, [row(0, 5), row(1, 4)]) for name in "ab")
    words = words_of(a, b)
    assert "All 2 runs of the same seeds are the same to the last bit" in words
    assert "The same program, objects and scenario." in words


def test_what_differs_is_counted_in_pairs(tmp_path: Path) -> None:
    a = write_batch(tmp_path / "a", [row(i, 4) for i in range(8)])
    b = write_batch(tmp_path / "b", [row(i, 5) for i in range(7)] + [row(11, 0)], settings={"objects": 5, "code": "c"})
    told = paired_difference(read_batch(a)["episodes"], read_batch(b)["episodes"])
    assert told is not None and (told.runs, told.differ) == (7, 7)
    assert told.share == pytest.approx(0.2), "every pour by one of five"
    assert told.low95 < 0.1 and told.high95 > 0.3, "seven of 35 objects, as if each were on its own"
    assert told.p_value == pytest.approx(2 / 2**7)
    words = words_of(a, b)
    assert "B sorted +0.200 of the objects against A" in words and ": more than chance would give, p = 0.016" in words
    assert "not there" in words and "+1" in words, "seeds 7 and 11 are in one of them alone"
    assert "another version of the program" in words


def test_few_pairs_that_differ_are_no_proof_however_many_do_not(tmp_path: Path) -> None:
    a = write_batch(tmp_path / "a", [row(i, 5) for i in range(40)])
    b = write_batch(tmp_path / "b", [row(i, 4 if i < 5 else 5) for i in range(40)])
    told = paired_difference(read_batch(a)["episodes"], read_batch(b)["episodes"])
    assert told is not None and told.high95 > -0.001, "by draws of runs alone it would be sure"
    assert told.p_value == pytest.approx(2 / 2**5)
    assert "chance may have given it, p = 0.062" in words_of(a, b)
    larger = write_batch(tmp_path / "c", [row(i, 9, total=10) for i in range(40)])
    assert paired_difference(read_batch(a)["episodes"], read_batch(larger)["episodes"]) is None, "other pours"


def test_where_no_pair_differs_the_interval_says_how_little_that_proves(tmp_path: Path) -> None:
    ends = []
    for n in (2, 20, 60):
        rows = [row(i, 5) | {"digest": str(i)} for i in range(n)]
        told = paired_difference(rows, [one | {"digest": "other"} for one in rows])
        assert told is not None and (told.differ, told.share, told.p_value) == (0, 0.0, 1.0)
        assert told.low95 == pytest.approx(-told.high95)
        ends.append(told.high95)
    assert ends == pytest.approx([1 - 0.025 ** (1 / (5 * n)) for n in (2, 20, 60)]), "the exact bound of none of them"


def test_of_two_runs_nothing_is_made(tmp_path: Path) -> None:
    a, b = (
        write_batch(tmp_path / name, [row(i, done, total=1) for i in range(2)]) for name, done in (("a", 1), ("b", 0))
    )
    words = words_of(a, b)
    assert (
        "B sorted -1.000 of the objects against A (95 % interval -1.000 to +0.191)" in words
        and "chance may have given it, p = 0.5" in words
    )
    assert "2 of 2" in words_of(a) and "objects sorted: 1.000, 95 % interval 0.158 to 1.000" in words_of(a)


def test_a_run_that_died_counts_in_either_batch(tmp_path: Path) -> None:
    """Whose crash it is must not favour anybody."""
    died = DIED | {"seed": 1}
    whole = read_batch(write_batch(tmp_path / "a", [row(0, 5), row(1, 5)]))["episodes"]
    half = read_batch(write_batch(tmp_path / "b", [row(0, 5), died]))["episodes"]
    there, back = paired_difference(whole, half), paired_difference(half, whole)
    assert there is not None and back is not None
    assert (there.runs, there.share, back.runs, back.share) == (2, -0.5, 2, 0.5)


def test_without_a_seed_in_common_nothing_is_paired(tmp_path: Path) -> None:
    a, b = write_batch(tmp_path / "a", [row(0, 5)]), write_batch(tmp_path / "b", [row(1, 4)])
    assert paired_difference(read_batch(a)["episodes"], read_batch(b)["episodes"]) is None
    assert "no seed in common" in words_of(a, b)


def test_a_batch_that_has_just_begun_has_a_page(tmp_path: Path) -> None:
    assert "None is done." in words_of(write_batch(tmp_path / "a", [], runs=4))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "restore it, or take another folder"),
        ("[]", "batch: list; expected an object: not as `batch` writes it"),
        (
            '{"schema": "sum-drake/batch/9"}',
            "batch.json: batch.schema: 'sum-drake/batch/9'; expected 'sum-drake/batch/1': not as `batch` writes it",
        ),
        ('{"schema": "sum-drake/batch/1"}', "settings"),
        ('{"schema": "sum-drake/batch/1", "settings": 3}', "batch.settings: int; expected an object"),
    ],
)
def test_what_is_no_batch_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "batch.json").write_text(text)
    with pytest.raises(InputError, match=r"batch\.json") as refused:
        read_batch(tmp_path)
    assert said in str(refused.value) and str(refused.value).count("batch.json") == 1


def test_the_command_tells_batches_from_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = (write_batch(tmp_path / name, [row(0, 5), row(1, 4)]) for name in "ab")
    out = tmp_path / "both.html"
    assert main(["report", str(a), str(b), "--out", str(out)]) == 0 and out.exists()
    (a / "1").mkdir()
    (a / "1" / "report.html").write_text("<p>A run.</p>")
    assert main(["report", str(a)]) == 0
    page = (a / "report.html").read_text()
    assert 'href="1/report.html"' in page and 'href="0/report.html"' not in page, "one leads to the runs that are there"
    (b / "0").mkdir()
    (b / "0" / "report.html").write_text("<p>A run.</p>")
    write_json(b / "batch.json", json.loads((b / "batch.json").read_text()) | {"episodes": [row(0, 4), row(1, 3)]})
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for page, leads in ((out, True), (elsewhere / "both.html", False)):
        assert main(["report", str(a), str(b), "--force", "--out", str(page)]) == 0
        found = set(re.findall(r'href="([^"]*)"', page.read_text()))
        assert found == ({"a/1/report.html", "b/0/report.html"} if leads else set()), "to runs below the page"
    (tmp_path / "run").mkdir()
    assert main(["report", str(a), str(tmp_path / "run"), "--out", str(tmp_path / "no.html")]) == 2
    assert "not a batch" in capsys.readouterr().err
    assert json.loads((a / "batch.json").read_text())["runs"] == 2
