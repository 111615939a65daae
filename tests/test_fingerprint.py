"""Results of another program, or of other objects, are told from this one's."""

import ast
from pathlib import Path

from sum_drake.fingerprint import UNREAD_BY_RUNS, code, code_and_meshes, code_of_runs, different, models
from sum_drake.objects import load_catalogue


def test_all_of_the_program_and_of_its_data_tells_rows_apart(tmp_path):
    package, systems, data = tmp_path / "package", tmp_path / "systems", tmp_path / "models" / "problems"
    for folder in (package, systems, data):
        folder.mkdir(parents=True)
    for name in ("systems", "models"):
        (package / name).symlink_to(tmp_path / name)  # as in a checkout
    told = {(code(package), models(package))}
    for file in (package / "a.py", systems / "b.py", data / "shelf.json", data / "robot.urdf", data / "piece.obj"):
        for text in ("1", "2"):
            file.write_text(text)
            told.add((code(package), models(package)))
    assert len(told) == 11
    (data / "print.png").write_text("a picture")
    (package / "notes.md").write_text("words")
    assert (code(package), models(package)) in told


def test_what_measures_runs_leaves_them_what_they_are(tmp_path):
    (tmp_path / "bench").mkdir()
    told = set()
    for text in ("1", "2"):
        (tmp_path / "bench" / "sort.py").write_text(text)
        told.add((code(tmp_path), code_of_runs(tmp_path)))
    assert len({whole for whole, _ in told}) == 2 and len({of_runs for _, of_runs in told}) == 1
    (tmp_path / "belief.py").write_text("3")
    assert code_of_runs(tmp_path) not in {of_runs for _, of_runs in told}


def test_nothing_but_benches_imports_them():
    """Or a run could differ, and `code_of_runs` be the same."""
    package = Path(__file__).parents[1] / "sum_drake"
    unread = tuple(f"sum_drake.{name}" for name in UNREAD_BY_RUNS)
    for file in [*package.rglob("*.py"), *(package.parent / "systems").rglob("*.py")]:
        if file.is_relative_to(package / "bench") or file.match("commands/bench*.py"):
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            names += [f"{node.module}.{one.name}" for one in node.names] if isinstance(node, ast.ImportFrom) else []
            assert not any(name.startswith(unread) for name in names), file


def test_collision_pieces_and_simulation_models_of_a_catalogue_tell_rows_apart(tmp_path):
    mesh = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    for name in ("a.obj", "piece.obj"):
        (tmp_path / name).write_text(mesh)
    (tmp_path / "own.yaml").write_text("objects: {a: {mesh: a.obj, category: thing, collision: [piece.obj]}}")
    catalogue = load_catalogue(tmp_path / "own.yaml")
    before = code_and_meshes(catalogue)
    assert code_and_meshes(catalogue) == before
    (tmp_path / "piece.obj").write_text(mesh.replace("0.1", "0.2"))
    after = code_and_meshes(catalogue)
    assert {key for key in after if after[key] != before[key]} == {"meshes"}


def test_what_differs_is_said_in_words():
    begun = {"code": "a", "objects": 5, "catalogue": "objects.yaml"}
    assert different(begun, begun) == ""
    assert (
        different(begun, {**begun, "code": "b", "objects": 10})
        == "another version of the program, objects 5 and not 10"
    )
