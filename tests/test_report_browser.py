"""Reports in a real browser, headless: at desktop and phone width the page never scrolls sideways, and it prints."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from run_folders import executed, write_run

from sum_drake.objects import load_catalogue
from sum_drake.report import write_report
from sum_drake.report_compare import write_comparison

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
WIDTHS = (1280, 390)
_ASK = """<script>
const frame = document.querySelector('iframe');
frame.onload = () => {
  const page = frame.contentDocument, root = page.documentElement;
  const video = page.querySelector('video');
  const done = () => document.body.setAttribute('data-said', JSON.stringify({
    width: frame.contentWindow.innerWidth, scroll: root.scrollWidth, height: root.scrollHeight,
    broken: [...page.images].filter(i => !i.naturalWidth).length,
    played: video ? video.duration : 0, error: video && video.error ? video.error.code : 0}));
  if (video && video.readyState < 1) { video.onloadedmetadata = done; video.onerror = done; video.load(); } else done();
};
frame.srcdoc = frame.dataset.page;
</script>"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A report with its film, one of a run that was cut off, and one of two runs."""
    folder = tmp_path_factory.mktemp("runs")
    catalogue = load_catalogue()
    one, two = write_run(folder / "one", catalogue), write_run(folder / "two", catalogue, executed(released=False))
    cut = write_run(folder / "cut", catalogue)
    for name in ("summary.json", "scenario.yaml"):
        (cut / name).unlink()
    (cut / "run.mcap").write_bytes((cut / "run.mcap").read_bytes()[:-2000])
    return {
        "run": write_report(one, film=True),
        "cut": write_report(cut),
        "two": write_comparison(one, two, folder / "two.html"),
    }


def browse(*arguments: str, cwd: Path) -> str:
    command = [str(BROWSER), "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", *arguments]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=True, timeout=300)
    return done.stdout


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("which", ["run", "cut", "two"])
def test_the_page_fits_its_width(pages: dict[str, Path], which: str, width: int, tmp_path: Path) -> None:
    # In a frame of its own: windows of a browser are no narrower than 500 pixels.
    held = html.escape(pages[which].read_text())
    style = f"border:0;width:{width}px;height:900px"
    (tmp_path / "wrap.html").write_text(
        '<!DOCTYPE html><meta charset="utf-8"><body style="margin:0">'
        f'<iframe style="{style}" data-page="{held}"></iframe>{_ASK}</body>'
    )
    window = f"--window-size={max(width, 500)},900"
    address = (tmp_path / "wrap.html").as_uri()
    dom = browse(window, "--virtual-time-budget=20000", "--dump-dom", address, cwd=tmp_path)
    match = re.search(r'data-said="([^"]*)"', dom)
    assert match is not None, "the page was loaded"
    said = json.loads(html.unescape(match[1]))
    assert said["width"] == width and said["scroll"] <= width
    assert said["height"] > 900 and said["broken"] == 0 and said["error"] == 0
    assert (said["played"] > 0) == (which == "run"), "the browser reads the film"
    browse(window, "--virtual-time-budget=20000", "--screenshot=page.png", address, cwd=tmp_path)
    picture = cv2.imread(str(tmp_path / "page.png"))[:, :width]
    assert picture.shape[1] == width and np.unique(picture.reshape(-1, 3), axis=0).shape[0] > 50


def test_the_page_prints(pages: dict[str, Path], tmp_path: Path) -> None:
    browse("--print-to-pdf=page.pdf", pages["run"].as_uri(), cwd=tmp_path)
    pdf = (tmp_path / "page.pdf").read_bytes()
    assert pdf.startswith(b"%PDF") and len(re.findall(rb"/Type\s*/Page\b", pdf)) >= 2
