"""Draws the sorting diagram as it is built: docs/diagram.dot, and docs/diagram.svg by Graphviz's `dot`, if there.

    python docs/draw_diagram.py

Debian's `graphviz` has `dot`. Without it the .dot file is written alone, and the picture is left as it was.
"""

import contextlib
import html
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pydrake.systems.framework import Diagram

from sum_drake.objects import load_catalogue
from sum_drake.runlog import RunLogWriter
from sum_drake.systems.scenario import load_scenario
from sum_drake.systems.sorting import make_sorting

DOT = Path(__file__).parent / "diagram.dot"
ORDER = (
    "station", "frame_assembler", "object_detector", "data_associator", "scene_estimator", "sorting_planner",
    "arm_controller",
)  # fmt: skip
"""The loop, from top to bottom; what leads back does not decide where a system stands."""
ASIDE = ("run_log", "referee", "executed_state", "executed_effort")
"""What only listens is drawn faintly."""
TABLE = 'border="0" cellborder="1" cellspacing="0" cellpadding="4"'


@contextlib.contextmanager
def built() -> Iterator[Diagram]:
    """The diagram of the default scenario with its log; what lies on the table makes no difference."""
    catalogue = load_catalogue()
    X_WO = np.eye(4)
    X_WO[:3, 3] = 0.6, 0.0, 1.0
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        yield make_sorting(
            load_scenario(catalogue=catalogue),
            {"sugar": X_WO},
            catalogue,
            open_log=lambda: stack.enter_context(RunLogWriter(Path(folder) / "run.mcap")),
        )


def connections(diagram: Diagram) -> list[tuple[str, str, str, str]]:
    """(system, output port, system, input port) of each connection between the systems of a diagram, sorted."""
    found = []
    for (target, into), (source, out) in diagram.connection_map().items():
        output, input = source.get_output_port(out), target.get_input_port(into)
        found.append((source.get_name(), output.get_name(), target.get_name(), input.get_name()))
    return sorted(found)


def dot(diagram: Diagram) -> str:
    """The systems of a diagram with their connected ports, and the connections, in Graphviz's language."""
    joined = connections(diagram)
    lines = [
        "digraph sorting {",
        '  graph [nodesep=0.3, ranksep=0.55, fontname="Helvetica"];',
        '  node [shape=plain, fontname="Helvetica", fontsize=12];',
        '  edge [arrowsize=0.6, color="#44505c"];',
    ]
    for system in sorted(diagram.GetSystems(), key=lambda system: system.get_name()):
        name, kind = system.get_name(), type(system).__name__
        inputs = _row("in", {into for _, _, target, into in joined if target == name})
        outputs = _row("out", {out for source, out, _, _ in joined if source == name})
        color = "#eef0f2" if name in ASIDE else "#d8e6fb"
        head = f'<tr><td bgcolor="{color}"><b>{name}</b><br/>{html.escape(kind)}</td></tr>'
        lines.append(f'  "{name}" [label=<<table {TABLE}>{inputs}{head}{outputs}</table>>];')
    for source, out, target, into in joined:
        style = [f'id="{source}/{out}/{target}/{into}"']  # by which the picture tells its connections
        if target in ASIDE:
            style.append('color="#b8c0c8"')
        elif {source, target} <= set(ORDER) and ORDER.index(target) <= ORDER.index(source):
            style.append("constraint=false")
        lines.append(f'  "{source}":"out {out}":s -> "{target}":"in {into}":n [{", ".join(style)}];')
    return "\n".join([*lines, "}", ""])


def _row(side: str, ports: set[str]) -> str:
    """The ports of one side, beside each other."""
    if not ports:
        return ""
    cells = "".join(f'<td port="{side} {port}">{port}</td>' for port in sorted(ports))
    return f'<tr><td border="0" cellpadding="0"><table {TABLE}><tr>{cells}</tr></table></td></tr>'


def main() -> int:
    """Builds, writes, draws."""
    with built() as diagram:
        DOT.write_text(dot(diagram))
    print(DOT)
    if shutil.which("dot") is None:
        print("draw_diagram: no `dot`; expected Debian's graphviz to draw diagram.svg from it", file=sys.stderr)
        return 1
    picture = DOT.with_suffix(".svg")
    subprocess.run(["dot", "-Tsvg", str(DOT), "-o", str(picture)], check=True)
    print(picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
