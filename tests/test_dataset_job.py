import dataclasses
import json
import re
import shutil
from pathlib import Path

import pytest

from sum_drake import cli
from sum_drake.assets import InputError
from sum_drake.detection import dataset_job, dataset_scenes
from sum_drake.detection.dataset import SCHEMA, SPLITS, ImageSet, is_scored, read_settings
from sum_drake.detection.dataset_job import FULL, QUICK, Plan, catalogue_hash, describe, render_dataset
from sum_drake.objects import Catalogue, load_catalogue

TINY = Plan(scenes=dict.fromkeys(SPLITS, 1), views={"train": 2, "validation": 1, "test": 1, "shift": 1}, seed=5)


@pytest.fixture(scope="module")
def catalogue() -> Catalogue:
    return load_catalogue()


@pytest.fixture(scope="module")
def rendered(catalogue: Catalogue, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("data") / "detect"
    told: list[tuple[str, int, int]] = []
    render_dataset(catalogue, out, TINY, report=lambda *what: told.append(what))
    assert told.pop(0)[:2] == ("rendering", 0)
    assert told == [
        ("validation/00000", 1, 5), ("train/00000", 3, 5), ("test/00000", 4, 5), ("shift/00000", 5, 5),
    ]  # fmt: skip
    return out


@pytest.fixture
def copy(rendered: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(rendered, tmp_path / "copy"))


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def ignore(*what: object) -> None:
    pass


def test_what_is_written_is_what_is_rendered(rendered: Path, catalogue: Catalogue) -> None:
    [image] = ImageSet(rendered, "test")
    [again] = dataset_scenes.render_scene(catalogue, "test", TINY.seed, 0, 1)
    assert (image.name, image.camera, image.objects) == (again.name, again.camera, again.objects)
    assert (image.color == again.color).all() and (image.depth == again.depth).all()
    assert len(ImageSet(rendered, "train")) == 2 and ImageSet(rendered, "train").complete
    assert ImageSet(rendered, "shift").labels == catalogue.labels


def test_workers_write_the_same_bytes_and_a_second_call_goes_on(
    rendered: Path, copy: Path, catalogue: Catalogue
) -> None:
    for lost in ("train/00000", "shift/00000"):
        shutil.rmtree(copy / lost)
    untouched = (copy / "test" / "00000" / "0.jpg").stat().st_mtime_ns
    told: list[tuple[str, int, int]] = []
    render_dataset(catalogue, copy, TINY, workers=2, report=lambda *what: told.append(what))
    assert told.pop(0) == ("rendering", 0, 3)
    assert sorted(name for name, _, _ in told) == ["shift/00000", "train/00000"] and told[-1][1:] == (3, 3)
    assert files(copy) == files(rendered)
    assert (copy / "test" / "00000" / "0.jpg").stat().st_mtime_ns == untouched


def test_a_finished_set_is_left_as_it_is(copy: Path, catalogue: Catalogue) -> None:
    before = files(copy)
    render_dataset(catalogue, copy, TINY, report=lambda *what: pytest.fail("rendered again"))
    assert files(copy) == before


def test_a_set_made_otherwise_is_refused(copy: Path, catalogue: Catalogue) -> None:
    before = files(copy)
    for other, key in (
        (dataclasses.replace(TINY, seed=6), "seed"),
        (dataclasses.replace(TINY, views={**TINY.views, "train": 3}), "views"),
    ):
        with pytest.raises(InputError, match=f"was made with another '{key}'; expected the same, or a new folder"):
            render_dataset(catalogue, copy, other, report=ignore)
    one = Catalogue(catalogue.path, catalogue.models[:1])
    with pytest.raises(InputError, match="another 'catalogue'"):
        render_dataset(one, copy, TINY, report=ignore)
    assert files(copy) == before


def test_a_foreign_folder_is_refused_and_kept(tmp_path: Path, catalogue: Catalogue) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match="no data set"):
        render_dataset(catalogue, tmp_path, TINY, report=ignore)
    with pytest.raises(InputError, match="a file; expected a folder"):
        render_dataset(catalogue, tmp_path / "thesis.tex", TINY, report=ignore)
    assert files(tmp_path) == {"thesis.tex": b"years of work"}


@pytest.mark.parametrize("error", [RuntimeError("no\nGPU"), SystemExit("DRAKE_DEMAND failed")])
def test_a_scene_that_fails_is_named_and_the_finished_ones_stay(
    error: BaseException, copy: Path, catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise error

    shutil.rmtree(copy / "test" / "00000")
    monkeypatch.setattr(dataset_scenes, "render_encoded", fail)
    with pytest.raises(RuntimeError, match="scene test/00000 cannot be rendered: ") as raised:
        render_dataset(catalogue, copy, TINY, report=ignore)
    assert "\n" not in str(raised.value)
    assert (copy / "train" / "00000").is_dir() and not (copy / "test" / "00000").exists()


def test_workers_that_die_are_one_line(copy: Path, catalogue: Catalogue, tmp_path: Path) -> None:
    shutil.rmtree(copy / "test" / "00000")
    gone = Catalogue(tmp_path / "gone.yaml", catalogue.models)  # They cannot begin without it.
    with pytest.raises(RuntimeError, match="a worker died, perhaps for lack of memory; the same command goes on"):
        render_dataset(gone, copy, TINY, workers=2, report=ignore)
    assert (copy / "train" / "00000").is_dir() and not (copy / "test" / "00000").exists()


def test_the_table_counts_what_is_asked_for(rendered: Path, catalogue: Catalogue) -> None:
    lines = describe(rendered).splitlines()
    assert lines[0].split() == list(SPLITS)
    assert lines[1].split() == ["pictures", "2", "1", "1", "1"]
    table = {line.split()[0]: [int(n) for n in line.split()[1:]] for line in lines[2 : 3 + len(catalogue)]}
    assert list(table) == [*catalogue.labels, "objects"]
    for column, split in enumerate(SPLITS):
        shown = [o for image in ImageSet(rendered, split) for o in image.objects if is_scored(o)]
        assert table["objects"][column] == len(shown) == sum(table[label][column] for label in catalogue.labels)


def test_the_default_sizes_are_at_least_the_papers() -> None:
    assert set(FULL.scenes) == set(FULL.views) == set(QUICK.scenes) == set(QUICK.views) == set(SPLITS)
    assert FULL.scenes["test"] >= 200 and FULL.scenes["shift"] >= 200
    assert FULL.scenes["train"] * FULL.views["train"] >= 3000


def test_the_catalogues_hash_is_that_of_what_it_looks_like(catalogue: Catalogue, tmp_path: Path) -> None:
    shutil.copytree(catalogue.path.parent, tmp_path / "objects", ignore=shutil.ignore_patterns("__pycache__"))
    moved = tmp_path / "objects" / "catalogue.yaml"
    assert catalogue_hash(load_catalogue(moved)) == catalogue_hash(catalogue)
    picture = tmp_path / "objects" / "mug" / "mug.png"
    picture.write_bytes(picture.read_bytes() + b"\0")
    assert catalogue_hash(load_catalogue(moved)) != catalogue_hash(catalogue)


def test_the_files_are_described(rendered: Path) -> None:
    words = set(re.findall(r"[\w/-]+", (Path(__file__).parents[1] / "docs" / "formats.md").read_text()))
    scene = json.loads((rendered / "train" / "00000" / "scene.json").read_text())
    view = scene["views"][0]
    keys = {*read_settings(rendered), *scene, *view, *view["camera"], *view["objects"][0]}
    assert keys | {SCHEMA, *SPLITS} <= words


# --- the command -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--scenes", "1", "0", "1", "1"], "--scenes 1 0 1 1: expected four counts of at least 1"),
        (["--workers", "0"], "--workers 0: expected at least 1"),
        (["--seed", "-1"], "--seed -1: expected at least 0"),
        (["--catalogue", "none.yaml"], "catalogue none.yaml is missing"),
    ],
)
def test_bad_arguments_are_one_line_and_write_nothing(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["dataset", "--out", str(tmp_path / "data"), *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not (tmp_path / "data").exists()


def test_the_command_goes_on_and_ends_with_the_table(
    copy: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(dataset_job, "FULL", TINY)
    shutil.rmtree(copy / "test" / "00000")
    assert cli.main(["dataset", "--out", str(copy), "--seed", "5", "--workers", "1"]) == 0
    captured = capsys.readouterr()
    assert captured.out == describe(copy) + "\n"
    assert captured.err == "rendering: 0 of 1\ntest/00000: 1 of 1, 0 s left\n"
    assert read_settings(copy)["seed"] == 5
