"""Takes results of benches over into results/, as they are committed: one row a line, to five digits.

    python benchmarks/keep_results.py out/pose out/b60/batch.json=batch5 ...

Of a bench its folder; of a batch its batch.json, and the name that it is to have, as has a bench's result of which
there is another kind (`pose` of some methods, `ablations` with faults). Columns that nothing here reads are left out:
poses of `pose` and features of `reject`. Pictures of a bench go to plots/. Then `python benchmarks/tables.py`.
"""

import argparse
import json
from pathlib import Path
from typing import Any

from sum_drake.bench.ablations import VARIANTS
from sum_drake.bench.pose_methods import METHODS
from sum_drake.bench.results import SCHEMA
from sum_drake.files import write_whole

RESULTS = Path(__file__).resolve().parent / "results"
PLOTS = RESULTS.parent / "plots"
PICTURES = {"pose": "corrected.jpg"}
"""That a bench writes beside its results, by the name under which these are kept."""
LEFT_OUT = {"pose": ("X_WO",), "reject": ("features",)}
"""Columns, by bench."""
DIGITS = 5


def kept(data: dict[str, Any]) -> str:
    """The text of a result as it is committed."""
    without = LEFT_OUT.get(data.get("bench", ""), ())
    head = {key: value for key, value in data.items() if key not in ("rows", "episodes")}
    text = json.dumps(head, indent=1)
    for name in ("rows", "episodes"):
        if name in data:
            rows = [_rounded({key: value for key, value in row.items() if key not in without}) for row in data[name]]
            lines = ",\n".join(f"  {json.dumps(row)}" for row in rows)
            text = f'{text[:-2]},\n "{name}": [\n{lines}\n ]\n}}'
    return text + "\n"


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, dict):
        return {key: _rounded(one) for key, one in value.items()}
    return [_rounded(one) for one in value] if isinstance(value, list) else value


def special(data: dict[str, Any]) -> str:
    """Why a bench's result is not the one that bears its name; "" if it is."""
    settings = data["settings"]
    if settings.get("faults"):
        return "with faults"
    if data["bench"] == "sort" and not settings.get("batches"):
        return "of the sequences alone"
    for bench, parts, all_parts in (("pose", "methods", METHODS), ("ablations", "variants", VARIANTS)):
        if data["bench"] == bench and set(settings[parts]) != set(all_parts):
            return f"of {', '.join(settings[parts])}"
    return ""


def main() -> None:
    """Writes them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", nargs="+", metavar="FOLDER[=NAME] | FILE=NAME")
    for text in parser.parse_args().results:
        source, _, name = text.partition("=")
        file = Path(source) / "results.json" if Path(source).is_dir() else Path(source)
        data = json.loads(file.read_text())
        if not name and data.get("schema") != SCHEMA:
            parser.error(f"{file}: of no bench; expected one's results, or FILE=NAME")
        if data.get("done", 0) < data.get("runs", 0):
            parser.error(f"{file}: {data['done']} of {data['runs']} runs are done; expected all")
        if data.get("quick"):
            parser.error(f"{file}: of the short form; expected a bench without --quick")
        if not name and special(data):
            parser.error(f"{file}: {special(data)}; expected a name of its own, FOLDER=NAME")
        name = name or data["bench"]
        written = {RESULTS / f"{name}.json": kept(data).encode()}
        picture = file.parent / PICTURES.get(name, "")
        if picture.is_file():
            written[PLOTS / picture.name] = picture.read_bytes()
        for target, content in written.items():
            write_whole(target, content)
            print(target)


if __name__ == "__main__":
    main()
