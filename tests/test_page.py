import base64
import re

import cv2
import numpy as np

from sum_drake import page


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
