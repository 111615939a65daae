"""Builds the pages of this folder to HTML, and fails on dead links.

    python docs/build_docs.py --out build/docs

A link into the repository leads to a copy of the file beside the pages, so that they can be read without a network.
The README's links are checked, too. Links to other hosts are checked for their form alone: nothing is fetched.
Exit 0: built; 1: dead links, one line each; 2: bad input.
"""

import argparse
import dataclasses
import html
import re
import shutil
import sys
import urllib.parse
from collections.abc import Iterator, Sequence
from pathlib import Path

try:
    from markdown_it import MarkdownIt
    from markdown_it.token import Token
except ImportError:
    sys.exit("build_docs: markdown-it-py is not installed; expected pip install -e '.[docs]'")

DOCS = Path(__file__).parent
ROOT = DOCS.parent
ORDER = (
    "index", "getting_started", "concepts", "diagram", "extending", "logging", "batches", "commands", "formats",
    "paper", "measured", "limits",
)  # fmt: skip
"""Pages in the order of the navigation; others follow by name."""


@dataclasses.dataclass(frozen=True)
class Heading:
    """A heading of a page, and what a link to it says."""

    level: int
    words: str
    anchor: str


@dataclasses.dataclass(frozen=True)
class Link:
    """A link or picture of a page, and the line on which its paragraph begins, or it stands."""

    line: int
    target: str


@dataclasses.dataclass(frozen=True, eq=False)
class Page:
    """One Markdown file, parsed."""

    path: Path
    tokens: Sequence[Token]

    @property
    def title(self) -> str:
        """Words of its first heading."""
        return self.headings[0].words if self.headings else self.path.stem

    @property
    def headings(self) -> list[Heading]:
        """In their order, with the anchors that GitHub gives them."""
        found: list[Heading] = []
        taken: dict[str, int] = {}
        for opening, inline in zip(self.tokens, self.tokens[1:], strict=False):
            if opening.type != "heading_open":
                continue
            words = "".join(child.content for child in inline.children or () if child.type in ("text", "code_inline"))
            anchor = re.sub(r"[^\w -]", "", words).lower().replace(" ", "-")
            count = taken[anchor] = taken.get(anchor, -1) + 1
            found.append(Heading(int(opening.tag[1]), words, f"{anchor}-{count}" if count else anchor))
        return found

    @property
    def links(self) -> Iterator[Link]:
        """All of them, pictures too."""
        for token in self.tokens:
            if token.type != "inline":
                continue
            line = (token.map or [0])[0] + 1
            for child in token.children or ():
                line += child.type in ("softbreak", "hardbreak")
                if child.type in ("link_open", "image"):
                    yield Link(line, str(child.attrs["href" if child.type == "link_open" else "src"]))


def read_page(path: Path) -> Page:
    """Parses a Markdown file: CommonMark with tables, without raw HTML."""
    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    return Page(path, markdown.parse(path.read_text()))


def dead_links(page: Page, root: Path = ROOT) -> list[str]:
    """A line for each link of a page that leads nowhere: file, line, link, and what was expected."""
    return [
        f"{page.path.relative_to(root)}:{link.line}: {link.target}: {problem}"
        for link in page.links
        if (problem := _problem(page, link.target, root))
    ]


def _problem(page: Page, target: str, root: Path) -> str:
    parts = urllib.parse.urlsplit(target)
    if parts.scheme or parts.netloc:
        well_formed = parts.scheme in ("http", "https") and re.fullmatch(r"[\w-]+(\.[\w-]+)+(:\d+)?", parts.netloc)
        return "" if well_formed else "no web address; expected https://host/..."
    file = _file(page, target)
    if not file.is_relative_to(root):
        return "lies outside the repository; expected a file in it"
    if not file.is_file():
        return "no such file"
    if not parts.fragment:
        return ""
    if file.suffix != ".md":
        return "an anchor in a file that has none; expected a Markdown file"
    other = page if file == page.path else read_page(file)
    return "" if parts.fragment in {heading.anchor for heading in other.headings} else "no such heading"


def _file(page: Page, target: str) -> Path:
    """The file in the repository that a link without a host means."""
    path = urllib.parse.unquote(urllib.parse.urlsplit(target).path)
    return (page.path.parent / path).resolve() if path else page.path


def build(docs: Path, out: Path, root: Path = ROOT) -> list[str]:
    """Writes every page of a folder, the style sheet, and what they link to; returns the dead links, README's too.

    Pages with dead links are written all the same: a dead link is left out of the page, its words stay.
    """
    pages = sorted((read_page(path) for path in docs.glob("*.md")), key=lambda page: (_place(page), page.path.name))
    dead = [line for page in (*pages, read_page(root / "README.md")) for line in dead_links(page, root)]
    out.mkdir(parents=True, exist_ok=True)
    shutil.copy(docs / "style.css", out / "style.css")
    for page in pages:
        (out / f"{page.path.stem}.html").write_text(_html(page, pages, out, root))
    return dead


def _place(page: Page) -> int:
    return ORDER.index(page.path.stem) if page.path.stem in ORDER else len(ORDER)


def _html(page: Page, pages: Sequence[Page], out: Path, root: Path) -> str:
    """The whole page; copies the files that it links to below `out`."""
    anchors = iter(page.headings)
    for token in page.tokens:
        if token.type == "heading_open":
            token.attrs["id"] = next(anchors).anchor
        for child in token.children or ():
            if child.type in ("link_open", "image"):
                name = "href" if child.type == "link_open" else "src"
                child.attrs[name] = _address(page, str(child.attrs[name]), pages, out, root)
    body = MarkdownIt().renderer.render(page.tokens, MarkdownIt().options, {})
    body = body.replace("<table>", '<div class="wide"><table>').replace("</table>", "</table></div>")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{html.escape(page.title)} · sum-drake</title><link rel="stylesheet" href="style.css"></head>\n'
        f"<body>\n{_navigation(page, pages)}\n<main>\n{body}</main>\n</body></html>\n"
    )


def _address(page: Page, target: str, pages: Sequence[Page], out: Path, root: Path) -> str:
    """Where a link leads once it is built; a file that is no page is copied."""
    parts = urllib.parse.urlsplit(target)
    if parts.scheme or parts.netloc:
        return target
    fragment = f"#{parts.fragment}" if parts.fragment else ""
    file = _file(page, target)
    if any(file == other.path for other in pages):
        return f"{file.stem}.html{fragment}" if parts.path else fragment
    if not file.is_file() or not file.is_relative_to(root):
        return "#"
    # Browsers show text of other kinds as a download, if at all.
    as_is = file.suffix in (".svg", ".png", ".webp", ".html", ".txt")
    copy = Path("files") / (file.relative_to(root) if as_is else Path(f"{file.relative_to(root)}.txt"))
    (out / copy).parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(file, out / copy)
    return urllib.parse.quote(copy.as_posix())


def _navigation(page: Page, pages: Sequence[Page]) -> str:
    """All pages, and below this one its sections; folded away on a phone, without a script."""
    lines = []
    for other in pages:
        here = other is page
        current = ' aria-current="page"' if here else ""
        lines.append(f'<li><a href="{other.path.stem}.html"{current}>{html.escape(other.title)}</a>')
        sections = [heading for heading in other.headings if heading.level == 2] if here else []
        if sections:
            rows = (f'<li><a href="#{one.anchor}">{html.escape(one.words)}</a></li>' for one in sections)
            lines.append(f"<ul>{''.join(rows)}</ul>")
        lines.append("</li>")
    listed = "".join(lines)
    # Twice, of which the style sheet shows one: a folded list cannot be opened by a style sheet.
    return (
        f'<nav class="beside"><ul>{listed}</ul></nav>'
        f'<nav class="above"><details><summary>sum-drake: pages</summary><ul>{listed}</ul></details></nav>'
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Builds; tells what is dead."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "docs", metavar="DIR", help="default: build/docs")
    out = parser.parse_args(arguments).out
    if out.exists() and not (out.is_dir() and ((out / "style.css").is_file() or not any(out.iterdir()))):
        print(f"build_docs: --out {out}: holds something else; expected a new folder or built pages", file=sys.stderr)
        return 2
    dead = build(DOCS, out)
    for line in dead:
        print(line, file=sys.stderr)
    print(out / "index.html")
    return 1 if dead else 0


if __name__ == "__main__":
    sys.exit(main())
