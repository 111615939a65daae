import base64
import re

import cv2
import numpy as np

from sum_drake import page
from sum_drake.svg import drawing


def test_a_page_holds_its_parts_and_needs_no_network():
    html = page.page("Bench <detect>", ["<p>one</p>", page.tiles([("recall & more", "0.9")])])
    assert "<title>Bench &lt;detect&gt;</title>" in html
    assert "<p>one</p>" in html
    assert "recall &amp; more" in html
    assert not re.findall(r"""(?:src|href)=["']http""", html)


def test_columns_in_which_nothing_stands_are_left_out():
    html = page.table(("a", "b", "c"), [("1", "", "3"), ("4", "", "")])
    assert re.findall(r"<th>(.)</th>", html) == ["a", "c"]
    assert html.count("<td ") == 4
    assert re.findall(r"<th>(.)</th>", page.table(("a", "b"), [])) == ["a", "b"], "without rows there are heads"


def test_a_picture_is_within_the_page_in_its_colours():
    image = np.zeros((40, 60, 3), np.uint8)
    image[..., 0] = 200
    html = page.picture(image, 'a "red" one')
    assert 'alt="a &quot;red&quot; one"' in html
    data = base64.b64decode(re.search(r"base64,([^\"]*)", html)[1])
    read = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(read.astype(int) - [0, 0, 200]).max() < 10


def test_a_film_is_within_the_page_with_a_picture_for_paper():
    html = page.video(b"\x1a\x45\xdf\xa3", np.zeros((30, 40, 3), np.uint8), "the <run>")
    assert 'src="data:video/webm;base64,GkXfow=="' in html and 'poster="data:image/jpeg;base64,' in html
    assert 'width="40" height="30"' in html and "controls" in html and "the &lt;run&gt;" in html


def test_a_drawing_scrolls_in_its_own_box_and_names_no_address():
    html = page.figure(drawing(40, 30, "a map", ["<rect width='3' height='2'/>"]))
    assert html.startswith('<div class="scroll figure"><svg width=') and "http" not in html
    assert '<div class="scroll"><table>' in page.table(("a",), [("1",)])
