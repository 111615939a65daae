"""The paper's table beside ours, and figures of batches."""

import json

import pytest
from refusals import refused
from test_batch_figures import attempt, run

from sum_drake.assets import InputError
from sum_drake.batch import Processes, run_batch
from sum_drake.batch_folder import read_episodes
from sum_drake.bench.sort import AIMS, PAPER, aims_for, bench_sort, read_batches, sort_figures
from sum_drake.cli import main
from sum_drake.commands.batch import prepare
from sum_drake.systems.scenario import load_scenario


def pours(count, objects, first=0):
    places = {f"o{i}": "bin" for i in range(objects)}
    tries = [attempt(label, "sorted") for label in places]
    return [run(first + i, places, tries, objects_asked=objects) for i in range(count)]


def died(seed, objects):
    return {"seed": seed, "state": "crashed", "reason": "killed", "cpu_s": 3.0, "peak_memory_mib": 10.0,
            "objects_asked": objects}  # fmt: skip


def test_the_papers_table_is_the_papers():
    assert sum(PAPER["trials"]) == 43 and sum(PAPER["failed"]) == 6
    assert sum(share * count for share, count in zip(PAPER["completion"], PAPER["objects"], strict=True)) == 38


def test_figures_are_of_the_batches_by_number_of_objects_else_of_the_sequences():
    sequences = pours(8, 5)
    alone = sort_figures(sequences, [])
    assert (alone["runs"], alone["sequences"], alone["sequences_objects_sorted"]) == (8, 8, 40)
    assert "objects_sorted_share_10" not in alone
    lost = run(
        99, {"a": "bin", "b": "bin", "c": "bin", "d": "bin", "e": "floor"}, [attempt("e", "dropped")], objects_asked=5
    )
    both = sort_figures(sequences, [*pours(19, 5, 100), lost, *pours(4, 10, 200)])
    assert (both["runs"], both["runs_10"]) == (20, 4)
    assert both["objects_sorted_share"] == pytest.approx(0.99)
    assert both["objects_sorted_share_10"] == 1.0
    assert both["objects_sorted_low95"] <= 0.99 <= both["objects_sorted_high95"] <= 1.0
    assert set(AIMS) <= set(both)
    short = sort_figures(pours(2, 2), pours(3, 5, 100))
    assert (short["runs"], short["objects"]) == (3, 15), "what is asked of runs of five is not told of two of two"
    two = sort_figures(sequences, pours(3, 2, 100))
    assert (two["runs"], two["runs_2"], two["objects_sorted_share_2"]) == (8, 3, 1.0), "each number has its own"
    assert aims_for(pours(2, 5)) | aims_for(pours(2, 10)) == AIMS
    assert aims_for([]) == {}, "eight sequences cannot show what is asked of sixty pours"
    assert both["perception_cpu_s_median_10"] == 1.0 and both["picks_per_simulated_hour_10"] == 600.0
    crashed = sort_figures([*pours(7, 5), died(7, 5)], [*pours(3, 5, 100), *pours(3, 10, 200), died(203, 10)])
    assert (crashed["runs"], crashed["runs_10"], crashed["sequences_complete"]) == (3, 4, 7)
    assert crashed["objects_sorted_share_10"] == 0.75, "nothing is gained by a crash"


def test_sequences_are_run_and_told_and_gone_on_with(tmp_path):
    text = "{objects: {labels: [soup_can]}, simulation_duration: 0.3}"
    specs, settings = prepare(load_scenario(text=text, seed=3), 3, 2)
    told = [
        bench_sort(
            tmp_path, specs, settings, Processes(2), [], usual=lambda count: settings, quick=True,
            progress=lambda what, done, total: None,
        )
        for _ in range(2)
    ]  # fmt: skip
    assert told[0].keys() == told[1].keys() and told[0]["cpu_s_per_run_median"] == told[1]["cpu_s_per_run_median"]
    data = json.loads((tmp_path / "results.json").read_text())
    assert [row["seed"] for row in data["rows"] if row["table"] == "sequence"] == [3, 4]
    assert data["figures"]["objects_sorted_share"] == 0.0
    page = (tmp_path / "report.html").read_text()
    assert "The paper&#x27;s" in page or "The paper's" in page
    assert '<a href="sequences/4/report.html">4</a>' in page and "the short form" in page
    assert "2 runs of 1 object, seeds 3 to 4" in page and "Figures are of the sequences" in page
    assert len(read_episodes(tmp_path / "sequences")) == 2


def test_what_is_no_batch_is_refused_before_anything_is_run(tmp_path, capsys):
    (tmp_path / "b").mkdir()
    assert main(["bench", "sort", "--out", str(tmp_path / "out"), "--batch", str(tmp_path / "b")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "no batch" in line and not (tmp_path / "out").exists()


def test_a_batch_of_which_nothing_is_done_is_refused(tmp_path):
    specs, settings = prepare(load_scenario(seed=3), 3, 2)

    def interrupt(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_batch(tmp_path / "b", specs, settings, Processes(1), interrupt)
    with pytest.raises(InputError, match="none of its 2 runs is done; expected some"):
        read_batches([tmp_path / "b"], lambda count: settings)


def test_a_run_counts_once_and_the_page_says_what_the_runs_were_of(tmp_path, capsys):
    text = "{objects: {labels: [soup_can]}, simulation_duration: 0.3}"
    batch = ["batch", "--runs", "1", "--first-seed", "5", "--scenario-text", text, "--quiet"]
    for name in ("a", "b"):
        assert main([*batch, "--out", str(tmp_path / name)]) == 0
    assert capsys.readouterr().out.startswith("1 run: 0 of 1 objects sorted"), "results go there, quiet or not"
    line = refused(capsys, "bench", "sort", "--quick", "--out", str(tmp_path / "out"), "--batch", str(tmp_path / "a"))
    assert "is of another scenario" in line and not (tmp_path / "out").exists()
    specs, settings = prepare(load_scenario(text=text, seed=3), 3, 1)
    with pytest.raises(InputError, match="seed 5 is in"):
        read_batches([tmp_path / "a", tmp_path / "b"], lambda count: settings)
    bench_sort(
        tmp_path / "out", specs, settings, Processes(1), [tmp_path / "a"], usual=lambda count: settings, quick=True,
        progress=lambda what, done, total: None,
    )  # fmt: skip
    assert "1 run of 1 object, seed 5; commit" in (tmp_path / "out" / "report.html").read_text()
    data = json.loads((tmp_path / "out" / "results.json").read_text())
    assert [made["seeds"] for made in data["settings"]["batches"]] == [[5, 5]]
