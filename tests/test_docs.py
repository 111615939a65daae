"""The pages of docs/: they build, their links lead somewhere, and what they show is what there is."""

import re
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest

from sum_drake.cli import _parser, main
from sum_drake.systems.scenario import load_scenario

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))
pytest.importorskip("markdown_it", reason="the extra `docs`, which is part of `dev`, is not installed")

import build_docs  # noqa: E402
import draw_diagram  # noqa: E402
import write_commands  # noqa: E402

SHOWN = re.compile(r"```console checked\n\$ sum-drake ([^\n]*)\n(.*?)```", re.DOTALL)
PAGES = (*sorted(DOCS.glob("*.md")), ROOT / "README.md")
TYPED = [
    (page.name, line)
    for page in PAGES
    for text in [page.read_text()]
    for line in (
        re.findall(r"^Example: `(.*)`$", text, re.MULTILINE)
        if page == write_commands.PAGE  # its other lines have names in the place of values
        else [line for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL) for line in block.splitlines()]
    )
    if line.startswith("sum-drake ")
]
"""Page and line of each call of sum-drake that a page tells to type."""
CHECKED = [(page.name, command, output) for page in PAGES for command, output in SHOWN.findall(page.read_text())]
"""Page, arguments and output of each command whose output a page shows and marks as `checked`."""


def blocks(page: str) -> list[str]:
    """The Python of a page, each block with empty lines before it, so that an error tells the page's line."""
    text = (DOCS / page).read_text()
    found = re.finditer(r"```python\n(.*?)```", text, re.DOTALL)
    return ["\n" * text[: block.start(1)].count("\n") + block[1] for block in found]


def run_page(page: str) -> dict[str, Any]:
    """Runs the Python of a page from top to bottom; returns its names."""
    names: dict[str, Any] = {}
    for block in blocks(page):
        exec(compile(block, str(DOCS / page), "exec"), names)
    return names


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A repository with one page, README and style sheet."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "style.css").write_text("")
    (tmp_path / "README.md").write_text("# Read me\n")
    return tmp_path


def built(site: Path, page: str) -> tuple[list[str], str]:
    """Dead links, and the page as HTML."""
    (site / "docs" / "page.md").write_text(page)
    dead = build_docs.build(site / "docs", site / "out", site)
    return dead, (site / "out" / "page.html").read_text()


def test_all_pages_are_built_and_no_link_is_dead(tmp_path, capsys):
    assert build_docs.main(["--out", str(tmp_path)]) == 0, capsys.readouterr().err
    pages = {path.stem for path in DOCS.glob("*.md")}
    assert {path.stem for path in tmp_path.glob("*.html")} == pages >= set(build_docs.ORDER)
    for path in tmp_path.glob("*.html"):
        text = path.read_text()
        for target in re.findall(r'(?:href|src)="([^"#:]+)(?:#[^"]*)?"', text):
            assert (tmp_path / target).is_file(), f"{path.name}: {target}"
        outside = re.findall(r'(?:src|<link[^>]* href)="(https?:[^"]*)', text)
        assert not outside, "nothing is fetched"
        assert text.count("aria-current") == 2 and 'name="viewport"' in text


@pytest.mark.parametrize(
    ("link", "problem"),
    [
        ("[a](other.md)", "docs/page.md:3: other.md: no such file"),
        ("[a](#nowhere)", "docs/page.md:3: #nowhere: no such heading"),
        ("words\nand [a](../README.md#read-you)", "docs/page.md:4: ../README.md#read-you: no such heading"),
        ("![a](picture.png)", "docs/page.md:3: picture.png: no such file"),
        ("[a](../../etc/passwd)", "outside the repository"),
        ("[a](style.css#x)", "an anchor in a file that has none"),
        ("[a](https://nowhere)", "docs/page.md:3: https://nowhere: no web address"),
        ("[a](http:/example.org)", "no web address"),
        ("[a](<https://exa mple.org/>)", "no web address"),
        ("| b |\n|---|\n| [a](none.md) |", "none.md: no such file"),
    ],
)
def test_a_dead_link_is_told_with_its_line(site, link, problem):
    (told,), _ = built(site, f"# Page\n\n{link}\n")
    assert problem in told


def test_links_that_live_are_led_to_what_is_built(site):
    (site / "code").mkdir()
    (site / "code" / "x.py").write_text("x = 1\n")
    text = "# A `page_of` it: all\n\n## Twice\n\n## Twice\n\n[a](#a-page_of-it-all) [b](page.md#twice-1) "
    dead, html = built(site, text + "[c](../code/x.py) [d](https://example.org/x?y#z) [e](../README.md#read-me)\n")
    assert dead == []
    assert 'href="#a-page_of-it-all"' in html and 'id="a-page_of-it-all"' in html
    assert 'href="page.html#twice-1"' in html and 'id="twice-1"' in html
    assert 'href="files/code/x.py.txt"' in html and 'href="https://example.org/x?y#z"' in html
    assert (site / "out" / "files" / "code" / "x.py.txt").read_text() == "x = 1\n"


def test_dead_links_of_the_readme_are_told_too(site):
    (site / "README.md").write_text("# Read me\n\n[a](docs/none.md)\n")
    dead, _ = built(site, "# Page\n")
    assert dead == ["README.md:3: docs/none.md: no such file"]


def test_a_folder_that_holds_something_else_is_left_alone(tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("years of work")
    assert build_docs.main(["--out", str(tmp_path)]) == 2
    assert "holds something else" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_the_command_reference_is_that_of_the_command_line():
    assert write_commands.PAGE.read_text() == write_commands.page(), "run python docs/write_commands.py"


def test_the_picture_of_the_diagram_is_that_of_the_built_one():
    with draw_diagram.built() as diagram:
        joined = draw_diagram.connections(diagram)
        assert draw_diagram.DOT.read_text() == draw_diagram.dot(diagram), "run python docs/draw_diagram.py"
        systems = {system.get_name() for system in diagram.GetSystems()}
    picture = draw_diagram.DOT.with_suffix(".svg").read_text()
    assert sorted(re.findall(r'<g id="(\S+)" class="edge">', picture)) == sorted("/".join(ends) for ends in joined)
    assert set(re.findall(r'class="node">\s*<title>(.*?)</title>', picture)) == systems
    text = (DOCS / "diagram.md").read_text()
    assert all(f"`{system}`" in text for system in systems)


@pytest.mark.parametrize(("page", "command", "output"), CHECKED, ids=lambda value: str(value)[:40])
def test_output_that_a_page_shows_is_that_of_the_command(page, command, output, capsys):
    assert main(command.split()) == 0
    assert capsys.readouterr().out == output, page


def test_some_output_is_checked():
    assert CHECKED


@pytest.mark.parametrize(("page", "line"), TYPED, ids=lambda value: str(value)[:60])
def test_what_a_page_tells_to_type_is_a_command(page, line):
    typed = vars(_parser().parse_args(shlex.split(line)[1:]))
    name, text = typed.get("scenario_name"), typed.get("scenario_text")
    if name or text:
        load_scenario(None, name, text, objects=typed.get("objects"))


def test_the_diagram_from_python_sees_what_was_poured(capsys):
    names = run_page("getting_started.md")
    (label,) = names["X_WOs"]
    assert re.search(rf"^{label} .* accepted$", capsys.readouterr().out, re.MULTILINE)


def test_own_parts_work_as_they_stand(capsys):
    names = run_page("extending.md")
    shown = capsys.readouterr().out
    assert shown.startswith("(30.0, 20.0, 20.0, 10.0)\n")
    assert "cleared [0.59 0.1  1.07]" in shown
    assert abs(names["p_WG"][:2] - names["X_WO"][:2, 3]).max() < 0.02, "the hand is over the object"
    assert "done=True, stopped=''" in shown
    assert all(block.strip().count("\n") < 60 for block in blocks("extending.md"))
