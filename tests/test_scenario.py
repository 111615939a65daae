import pytest

from sum_drake.assets import MODELS, InputError
from sum_drake.bench.ablations import VARIANTS
from sum_drake.objects import CATALOGUE, load_catalogue
from sum_drake.systems.scenario import SCENARIOS, catalogue_of, dump_scenario, load_scenario


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


def test_default_scenario_sorts_by_category_into_two_bins(catalogue):
    scenario = load_scenario(catalogue=catalogue)
    assert scenario.goal == {"cleaning": "cleaning_bin", "non-cleaning": "non_cleaning_bin"}
    assert scenario.region("cleaning_bin").p_W[1] < 0 < scenario.region("non_cleaning_bin").p_W[1], "right, left"
    assert scenario.unique_labels
    assert scenario.task.policy == "most_likely"
    assert scenario.plant_config.time_step == 0.004


def test_the_paper_is_a_scenario(catalogue):
    paper = load_scenario(name="paper", catalogue=catalogue)
    assert (paper.filter, paper.task.policy, paper.task.spare_neighbours) == ("paper", "most_likely", False)
    ablation = load_scenario(text=VARIANTS["paper_filter"].changes, catalogue=catalogue)
    assert paper.acceptance == ablation.acceptance, "by a probability that knows this filter's estimates"


def test_text_seed_and_count_go_over_the_file(catalogue):
    text = "{random_seed: 4, filter: paper, objects: {count: 3}}"
    scenario = load_scenario(text=text, catalogue=catalogue)
    assert (scenario.random_seed, scenario.filter, scenario.objects.count) == (4, "paper", 3)
    scenario = load_scenario(text=text, seed=9, objects=2, catalogue=catalogue)
    assert (scenario.random_seed, scenario.objects.count) == (9, 2)


def test_the_resolved_scenario_reads_back_as_itself(catalogue, tmp_path):
    scenario = load_scenario(text="{objects: {labels: [mug, tide]}}", seed=7, catalogue=catalogue)
    file = tmp_path / "scenario.yaml"
    file.write_text(dump_scenario(scenario))
    again = load_scenario(file, catalogue=catalogue)
    assert dump_scenario(again) == dump_scenario(scenario)
    assert again.objects.labels == ["mug", "tide"]


def test_a_detectors_weights_are_named_by_a_path_that_holds_anywhere(catalogue, tmp_path, monkeypatch):
    file = tmp_path / "mine.yaml"
    file.write_text("mine: {detector: ObjectDetector, object_detector: {weights: w.safetensors, threshold: 0.4}}")
    scenario = load_scenario(file, catalogue=catalogue)
    assert scenario.object_detector.weights == str(tmp_path / "w.safetensors")
    assert scenario.object_detector.threshold == 0.4
    monkeypatch.chdir(tmp_path)
    given = load_scenario(text="{object_detector: {weights: w.safetensors}}", catalogue=catalogue)
    assert given.object_detector.weights == scenario.object_detector.weights
    assert load_scenario(catalogue=catalogue).object_detector.weights == "", "the package's own"
    (tmp_path / "resolved.yaml").write_text(dump_scenario(scenario))
    again = load_scenario(tmp_path / "resolved.yaml", catalogue=catalogue)
    assert dump_scenario(again) == dump_scenario(scenario)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{fliter: paper}", ["unknown key 'fliter'", "expected one of", "filter"]),
        ("{simulated_detector: {mis_rate: 0.1}}", ["simulated_detector", "unknown key 'mis_rate'", "miss_rate"]),
        ("{cameras: {head_camera: {widht: 3}}}", ["cameras: head_camera", "unknown key 'widht'"]),
        ("{objects: {count: 16}}", ["16 objects", "expected 1 to 15"]),
        ("{objects: {count: 0}}", ["0 objects", "expected 1 to"]),
        ("{objects: {labels: [unicorn]}}", ["'unicorn'", "expected one of", "tide"]),
        ("{objects: {labels: [mug, mug]}}", ["twice"]),
        ("{random_seed: -1}", ["random_seed -1"]),
        ("{random_seed: many}", ["random_seed is 'many'", "whole number"]),
        ("{filter: kalman}", ["filter 'kalman'", "paper"]),
        ("{detector: Oracle}", ["detector 'Oracle'", "ObjectDetector", "SimulatedDetector"]),
        ("{object_detector: {proposer: luck}}", ["proposer 'luck'", "edge_boxes"]),
        ("{object_detector: {threshold: 2}}", ["object_detector: threshold", "from 0 to 1"]),
        ("{task: {policy: luck}}", ["policy 'luck'", "most_likely"]),
        ("{acceptance: {by: luck}}", ["acceptance.by 'luck'", "existence, score"]),
        ("{goal: {cleaning: moon}}", ["'moon'", "cleaning_bin"]),
        ("{goal: {cleaning: leav}}", ["goal region 'leav' of 'cleaning'", "leave"]),
        ("{regions: {cleaning_bin: {p_W: [0.6, -0.4, 1.1], half_extents: [0.2, 0.2, 0.2]}}}",
         ["region cleaning_bin", "bottom is at 0.9 m", "top is at 0.7 m", "expected the same height"]),
        ("{regions: {cleaning_bin: {p_W: [0.1, -1.9, 0.5], half_extents: [0.2, 0.2, 0.2]}}}",
         ["region cleaning_bin", "out of reach, 1.70 m from", "shoulder", "at most 1.3 m"]),
        ("{goal: {vegetables: leave}}", ["'vegetables'", "cleaning"]),
        ("{regions: {table: {p_W: [1, 2], half_extents: [1, 1, 1]}}}", ["region table", "three numbers"]),
        ("{goal: {cleaning: table}}", ["'table'", "cleaning_bin"]),
        ("{cameras: {head_camera: {width: 2}}}", ["head_camera", "16 x 16"]),
        ("{depth_noise: {dropout: 7}}", ["dropout is 7", "probability"]),
        ("{simulated_detector: {miss_rate: -3}}", ["miss_rate is -3", "0 to 1"]),
        ("{task: {max_attempts: 0}}", ["max_attempts is 0", "1 or more"]),
        ("{pick: {lifts: []}}", ["lifts is empty"]),
        ("{pick: {approach: .nan}}", ["approach is nan", "finite"]),
        ("{plant_config: {time_step: 0}}", ["time_step 0", "more than 0"]),
        ("{plant_config: {contact_model: nonsense}}", ["plant_config", "nonsense"]),
        ("{faults: [{kind: earthquake}]}", ["faults: number 1", "'earthquake'", "slipped"]),
        ("{faults: [{kind: taken, observation: -1}]}", ["observation -1", "0 or more"]),
        ("{faults: [{kind: taken, object: unicorn}]}", ["'unicorn'", "expected one of"]),
        ("{objects: {labels: [mug]}, faults: [{kind: added, object: mug}]}", ["mug is poured", "another object"]),
        ("{objects: {count: 15}, faults: [{kind: added}]}", ["need 16 labels", "at most 15"]),
        ("{faults: [{sort: taken}]}", ["faults: number 1", "unknown key 'sort'"]),
        ("{filter: paper, filter: default}", ["'filter' is given twice"]),
        ("[1, 2]", ["expected a mapping"]),
        ("{a: [", ["expected YAML"]),
    ],
)  # fmt: skip
def test_bad_text_is_one_line_that_says_what_where_and_what_was_expected(catalogue, text, words):
    with pytest.raises(InputError) as error:
        load_scenario(text=text, catalogue=catalogue)
    message = str(error.value)
    assert "\n" not in message
    assert "--scenario-text" in message
    for word in words:
        assert word in message


def test_a_count_does_not_go_with_a_list_of_labels(catalogue):
    text = "{objects: {labels: [unicorn]}}"
    with pytest.raises(InputError, match=r"^--objects 2: .*--scenario-text lists objects.labels; expected one or the"):
        load_scenario(text=text, objects=2, catalogue=catalogue)


def test_what_is_nobodys_goal_may_be_anywhere_and_an_area_may_lie_on_the_table(catalogue):
    text = """{goal: {mug: corner}, regions: {
      corner: {p_W: [0.6, 0.3, 0.8], half_extents: [0.1, 0.1, 0.1]},
      store: {p_W: [9, 9, 9], half_extents: [1, 1, 1]}}}"""
    assert load_scenario(text=text, catalogue=catalogue).goal == {"mug": "corner"}


def test_unknown_files_and_names_are_refused(catalogue, tmp_path):
    with pytest.raises(InputError, match=r"nowhere.yaml.*expected a YAML file"):
        load_scenario(tmp_path / "nowhere.yaml", catalogue=catalogue)
    with pytest.raises(InputError, match=rf"'other'.*{SCENARIOS.name}.*expected one of sorting, paper"):
        load_scenario(name="other", catalogue=catalogue)


def test_a_file_of_ones_own_goes_over_the_packages_scenario(catalogue, tmp_path):
    file = tmp_path / "own.yaml"
    file.write_text("only_mugs: {goal: {mug: cleaning_bin}, objects: {count: 3}}")
    scenario = load_scenario(file, catalogue=catalogue)
    assert scenario.goal == {"mug": "cleaning_bin"}, "given whole, not merged"
    assert scenario.objects.count == 3
    assert "head_camera" in scenario.cameras


def test_a_goal_in_text_replaces_the_scenarios(catalogue):
    scenario = load_scenario(text="{goal: {mug: leave}}", catalogue=catalogue)
    assert scenario.goal == {"mug": "leave"}


@pytest.fixture
def own_catalogue(tmp_path):
    """A catalogue file of one's own with two objects."""
    meshes = MODELS / "objects"
    file = tmp_path / "kitchen" / "objects.yaml"
    file.parent.mkdir()
    file.write_text(
        "objects:\n"
        + "".join(
            f"  my_{name}: {{mesh: {meshes}/{name}/{name}.obj, sdf: {meshes}/{name}/{name}.sdf, category: {name}}}\n"
            for name in ("mug", "tea")
        )
    )
    return file


OWN = "{goal: {mug: cleaning_bin}, objects: {count: 2}, CATALOGUE}"


def test_the_resolved_scenario_names_the_catalogue_it_was_resolved_with(own_catalogue, tmp_path, monkeypatch):
    """So a run can be made again from its scenario alone, from wherever, after its catalogue came by an option."""
    monkeypatch.chdir(tmp_path)
    catalogue = load_catalogue(own_catalogue.relative_to(tmp_path))
    scenario = load_scenario(text=OWN.replace(", CATALOGUE", ""), catalogue=catalogue)
    (tmp_path / "scenario.yaml").write_text(dump_scenario(scenario))
    monkeypatch.chdir("/")
    again = load_scenario(tmp_path / "scenario.yaml")
    assert dump_scenario(again) == dump_scenario(scenario)
    assert catalogue_of(again).labels == ("my_mug", "my_tea")


def test_a_catalogue_in_a_scenario_is_found_from_its_file(own_catalogue, tmp_path, monkeypatch):
    (tmp_path / "own.yaml").write_text("own: " + OWN.replace("CATALOGUE", "catalogue: kitchen/objects.yaml"))
    assert load_scenario(tmp_path / "own.yaml").catalogue == str(own_catalogue.resolve())
    # The text of an option has no file: it starts where the command was called.
    monkeypatch.chdir(own_catalogue.parent)
    text = OWN.replace("CATALOGUE", "catalogue: objects.yaml")
    assert load_scenario(text=text).catalogue == str(own_catalogue.resolve())
    # What is given beside it goes over it.
    assert load_scenario(text="{catalogue: objects.yaml}", catalogue=load_catalogue()).catalogue == ""


@pytest.mark.parametrize(
    "path", [str(CATALOGUE), str(CATALOGUE.resolve()), "package://sum_drake/objects/catalogue.yaml"]
)
def test_the_packages_catalogue_needs_no_path(path):
    """A scenario that was resolved here can be run where the package lies elsewhere."""
    assert load_scenario(text=f"{{catalogue: '{path}'}}").catalogue == ""


def test_a_missing_catalogue_is_named_with_its_scenario(tmp_path):
    with pytest.raises(InputError, match=r"with --scenario-text: catalogue .*nowhere.yaml is missing: expected"):
        load_scenario(text="{catalogue: nowhere.yaml}")


def test_a_count_beyond_the_catalogue_is_laid_to_whoever_asked_for_it(own_catalogue):
    catalogue = load_catalogue(own_catalogue)
    with pytest.raises(InputError, match=r"^--objects: 3 objects; expected 1 to 2, as many as .*objects.yaml has$"):
        load_scenario(objects=3, catalogue=catalogue, text="{goal: {}}")
    with pytest.raises(InputError, match=r"^scenario 'sorting' of .* with --scenario-text: 3 objects; expected 1 to 2"):
        load_scenario(text="{objects: {count: 3}, goal: {}}", catalogue=catalogue)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{objects: {count: two}}", "objects: count is 'two'; expected a whole number"),
        ("{objects: {count: 2.7}}", "objects: count is 2.7; expected a whole number"),
        ("{objects: {count: true}}", "objects: count is True; expected a whole number"),
        ("{objects: {labels: mug}}", "objects: labels is 'mug'; expected a list"),
        ("{objects: {labels: [mug, 3]}}", "objects: labels: number 2 is 3; expected text"),
        ("{regions: {table: {p_W: [a, 1, 2]}}}", "regions: table: p_W: number 1 is 'a'; expected a number"),
        ("{unique_labels: maybe}", "unique_labels is 'maybe'; expected true or false"),
        ("{plant_config: {time_step: fast}}", "plant_config: time_step is 'fast'; expected a number"),
        ("{plant_config: {time_stop: 1}}", "plant_config: unknown key 'time_stop'; expected one of time_step"),
        ("{cameras: 3}", "cameras: 3; expected a mapping"),
    ],
)
def test_a_value_of_another_type_is_named_by_its_key(text, message):
    with pytest.raises(InputError) as error:
        load_scenario(text=text)
    assert str(error.value).startswith(f"--scenario-text: {message}")


def test_numbers_may_be_written_as_yaml_does_not_know_them():
    """1e-3 without a point is text to YAML 1.1, and a number to everybody else."""
    assert (
        load_scenario(text="{plant_config: {time_step: 1e-3}, simulation_duration: 60}").plant_config.time_step == 1e-3
    )
