import xml.etree.ElementTree as ET

from sum_drake.svg import drawing, segment, titled, words

SVG = "{http://www.w3.org/2000/svg}"


def test_a_drawing_is_whole_and_escapes_what_it_says():
    parts = [segment(0, 1, 2, 3, "#000", dashed=True), titled(words(4, 5, "a < b", turn=-90), "<mug> & co")]
    root = ET.fromstring(drawing(40, 30, "what's <this>", parts))
    assert (root.get("viewBox"), root.get("aria-label")) == ("0 0 40 30", "what's <this>")
    assert [text.text for text in root.iter(SVG + "text")] == ["a < b"]
    assert [title.text for title in root.iter(SVG + "title")] == ["<mug> & co"]
    (line,) = root.iter(SVG + "line")
    assert (line.get("x2"), line.get("stroke-dasharray")) == ("2.0", "5 4")
