"""Results of another program, or of other objects, are told from this one's."""

from sum_drake.fingerprint import code, code_and_meshes, different, models
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
