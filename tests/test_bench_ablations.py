"""What each ingredient is worth: variants are scenarios, differences are over pairs of pours."""

import json

import pytest
from test_batch_figures import attempt, run

from sum_drake.assets import InputError
from sum_drake.batch import Processes
from sum_drake.batch_folder import read_batch
from sum_drake.bench.ablations import DEFAULT, FIGURES, VARIANTS, bench_ablations, figures
from sum_drake.cli import main
from sum_drake.commands.batch import prepare
from sum_drake.systems.scenario import dump_scenario, load_scenario
from sum_drake.yamlio import parse_yaml


def pours(lost):
    """Runs of two objects; lost: how many, by run."""
    rows = []
    for seed, count in enumerate(lost):
        places = {f"o{i}": "floor" if i < count else "bin" for i in range(2)}
        rows.append(run(seed, places, [attempt(label, "sorted") for label in places], objects_asked=2))
    return rows


def test_every_variant_changes_the_scenario_in_a_way_of_its_own():
    texts = {name: dump_scenario(load_scenario(text=variant.changes)) for name, variant in VARIANTS.items()}
    assert texts[DEFAULT] == dump_scenario(load_scenario())
    assert len(set(texts.values())) == len(VARIANTS)
    names = list(VARIANTS)
    assert all(names.index(VARIANTS[name].against) < names.index(name) for name in names[1:])


def test_gains_are_over_the_pours_that_both_sorted():
    found = figures({DEFAULT: pours([0, 0, 1, 0]), "no_existence": pours([1, 1, 1, 1]), "no_memory": pours([0])})
    assert found["default.objects_sorted_share"] == pytest.approx(7 / 8)
    assert found["no_existence.objects_sorted_share"] == 0.5
    assert found["no_existence.gain"] == pytest.approx(-3 / 8)
    assert found["no_existence.gain_low95"] < -3 / 8 < found["no_existence.gain_high95"]
    assert (found["no_existence.pairs_that_differ"], found["no_existence.gain_p"]) == (3, 0.25), "no proof"
    assert found["no_memory.gain"] != found["no_memory.gain"], "of one pair nothing can be told"
    assert "default.gain" not in found
    digests = {DEFAULT: "ab", "no_memory": "ac"}
    same = figures({name: [row | {"digest": d} for row, d in zip(pours([0, 0]), of, strict=True)]
                    for name, of in digests.items()})  # fmt: skip
    assert same["no_memory.runs_the_same"] == 1 and found["no_existence.runs_the_same"] == 0, "without a digest, none"
    assert {f"default.{name}" for name in FIGURES} <= found.keys()


def test_a_variant_of_two_changes_is_compared_with_that_of_one():
    rows = {DEFAULT: pours([0, 0, 0]), "no_existence": pours([1, 1, 0]), "paper_filter": pours([2, 1, 0])}
    assert figures(rows)["paper_filter.gain"] == pytest.approx(-1 / 6)


def test_with_faults_it_is_told_how_many_were_dealt_with(tmp_path):
    def faulty(after):
        return [
            {**row, "faults": [{"kind": "slipped", "happened": True, "dealt_with_after": after}]} for row in pours([0])
        ]

    rows = {DEFAULT: faulty(1), "no_action_model": faulty(None)}
    found = figures(rows)
    assert (found["default.dealt_with_within_2"], found["no_action_model.dealt_with_within_2"]) == (1.0, 0.0)
    assert not any("dealt_with" in name for name in figures({DEFAULT: pours([0])}))
    texts = [dump_scenario(load_scenario(name="faults", text=one.changes)) for one in VARIANTS.values()]
    assert len(set(texts)) == len(VARIANTS), "each is a change of a scenario with faults, too"


def test_variants_are_run_told_and_gone_on_with(tmp_path):
    def prepared(text):
        short = {"objects": {"labels": ["soup_can"]}, "simulation_duration": 0.3, **parse_yaml(text, "a variant")}
        return prepare(load_scenario(text=json.dumps(short), seed=3), 3, 1)

    told = []
    for _ in range(2):
        found = bench_ablations(
            tmp_path / "out", prepared, Processes(2), variants=("default", "no_memory"), quick=True,
            progress=lambda what, done, total: told.append((what, done, total)),
        )  # fmt: skip
    assert told[-1][1:] == (1, 1) and {what.split(":")[0] for what, *_ in told} == {"default", "no_memory"}
    data = json.loads((tmp_path / "out" / "results.json").read_text())
    assert data["settings"]["variants"] == {name: VARIANTS[name].changes for name in ("default", "no_memory")}
    assert [(row["variant"], row["seed"]) for row in data["rows"] if row["table"] == "run"] == [
        ("default", 3), ("no_memory", 3)
    ]  # fmt: skip
    assert found["no_memory.objects_sorted_share"] == 0.0
    page = (tmp_path / "out" / "report.html").read_text()
    assert "grasps like one that failed are tried again" in page
    assert ">nan<" not in page, "what cannot be told is left out"
    # A batch may stand for the default: it is not run again.
    again = bench_ablations(
        tmp_path / "other", prepared, Processes(1), variants=("default", "no_memory"),
        default=tmp_path / "out" / "default", quick=True, progress=lambda what, done, total: None,
    )  # fmt: skip
    assert not (tmp_path / "other" / "default").exists() and again.keys() == found.keys()
    data = json.loads((tmp_path / "other" / "results.json").read_text())
    assert data["settings"]["default"]["seeds"] == [3, 3]


def test_a_default_that_is_of_something_else_is_refused(tmp_path):
    def prepared(duration, runs, text):
        short = {"objects": {"labels": ["soup_can"]}, "simulation_duration": duration, **parse_yaml(text, "a variant")}
        return prepare(load_scenario(text=json.dumps(short), seed=3), 3, runs)

    def bench(*default, duration=0.3, runs=1):
        return bench_ablations(
            tmp_path / str(duration), lambda text: prepared(duration, runs, text), Processes(1),
            variants=("no_memory",), default=default[0] if default else None, quick=True,
            progress=lambda what, done, total: None,
        )  # fmt: skip

    assert "no_memory.gain" in bench(), "what it is compared with is run though nobody named it"
    default = tmp_path / "0.3" / "default"
    with pytest.raises(InputError, match="is of another scenario; expected a batch of this program and scenario"):
        bench(default, duration=0.4)
    with pytest.raises(InputError, match="seed 4 is not done; expected 2 from 3"):
        bench(default, runs=2)
    told = read_batch(default)
    older = {**told["versions"], "drake": "1.0"}
    (default / "batch.json").write_text(json.dumps({**told, "versions": older}))
    with pytest.raises(InputError, match=r"is of drake 1\.0 and not"):
        bench(default)
    assert not (tmp_path / "0.4").exists()


def test_what_is_unknown_is_refused_before_anything_is_run(tmp_path, capsys):
    with pytest.raises(
        InputError, match="variant 'luck': unknown; expected some of default, no_existence, paper_filter"
    ):
        bench_ablations(tmp_path, lambda text: ([], {}), Processes(1), variants=("luck",), progress=print)
    (tmp_path / "b").mkdir()
    out = str(tmp_path / "out")
    for arguments, said in (
        (("--default", str(tmp_path / "b")), "no batch"),
        (("--runs", "0"), "--runs 0"),
        (("--variants", "luck"), "'luck'"),
    ):
        assert main(["bench", "ablations", "--out", out, *arguments]) == 2
        assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
