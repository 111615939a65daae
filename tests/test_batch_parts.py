"""Parts of pages about batches."""

from test_batch_report import DIED, row

from sum_drake.batch_parts import by_cause, every_loss, link, made_of, seeds_of, told_of

MADE = {
    "seeds": [5, 9], "runs": 5, "done": 3, "settings": {"objects": 1}, "commit": "abc", "device": "a <machine>",
    "versions": {"sum-drake": "0.1", "drake": "1.0", "numpy": "2.0"},
}  # fmt: skip


def test_a_batch_is_told_by_what_made_it():
    said = "3 runs of 1 object, seeds 5 to 9 of which 2 are not done; commit abc, on a <machine>."
    assert told_of(MADE) == said
    one = MADE | {"seeds": [5, 5], "runs": 1, "done": 1, "settings": {"objects": 10}, "commit": None}
    assert told_of(one) == "1 run of 10 objects, seed 5; commit unknown, on a <machine>."
    assert seeds_of(one) == "seed 5"
    html = made_of([MADE, MADE, one])
    assert html.count("3 runs of") == 1 and html.count("With sum-drake 0.1, drake 1.0.") == 1
    assert "&lt;machine&gt;" in html and "short form" not in html
    assert "the short form: too few runs" in made_of([MADE], quick=True)
    assert "With" not in made_of([MADE | {"versions": {}}])


def test_a_seed_leads_to_its_report_where_there_is_one(tmp_path):
    (tmp_path / "a b" / "5").mkdir(parents=True)
    assert link(5, "a b/5", tmp_path) == "5"
    (tmp_path / "a b" / "5" / "report.html").touch()
    assert link(5, "a b/5", tmp_path) == '<a href="a%20b/5/report.html">5</a>'
    assert link(5, "a b/5", None) == "5"


def test_every_loss_is_told_with_its_cause():
    rows = {"few": [row(0, 1, total=1)], "many": [row(1, 0, total=1), DIED | {"seed": 2, "objects_asked": 1}]}
    html = every_loss(rows, lambda kind, seed: f"<i>{kind} {seed}</i>", "variant")
    for part in ("Every one of them", "<i>many 1</i>", "thing0", "dropped: empty_hand", "the run crashed"):
        assert part in html, part
    assert "<i>few" not in html and html.count("<tr>") == 3
    assert every_loss({"few": rows["few"]}, lambda kind, seed: "") == ""
    assert "None." in by_cause({"few": {}})
    table = by_cause({"few": {}, "many": {"dropped": 2}})
    assert "dropped" in table and ">0<" in table and ">2<" in table
