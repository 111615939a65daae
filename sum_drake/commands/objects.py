"""`sum-drake objects`: the catalogue, or a user's own."""

import argparse
from pathlib import Path

from sum_drake.assets import InputError
from sum_drake.commands.common import (
    Commands,
    Counting,
    add_catalogue,
    add_command,
    add_group,
    add_quiet,
    anew_if_interrupted,
    check_writable,
)
from sum_drake.files import write_whole


def add(commands: Commands) -> None:
    """Declares the commands."""
    kinds = add_group(commands, "objects", "the catalogue, or your own", "WHAT", "objects list")
    text = "labels, categories, sizes, masses and symmetries"
    add_catalogue(add_command(kinds, "list", _list, text, "objects list"))
    add_catalogue(add_command(kinds, "check", _check, "whether each mesh is fit for use", "objects check"))
    render = add_command(kinds, "render", _render, "a contact sheet", "objects render --out sheet.png")
    add_catalogue(render)
    render.add_argument("--out", type=Path, metavar="FILE", default=Path("objects.png"), help="PNG to write")
    render.add_argument("--force", action="store_true", help="replace the file that is there")
    add_quiet(render)


def _list(options: argparse.Namespace) -> None:
    from sum_drake.objects import describe, load_catalogue

    print(describe(load_catalogue(options.catalogue)))


def _check(options: argparse.Namespace) -> None:
    from sum_drake.objects import CATALOGUE, check

    findings = check(options.catalogue, lambda finding: print(finding.line, flush=True))
    broken = sum(not finding.usable for finding in findings)
    if broken:
        raise InputError(
            f"{options.catalogue or CATALOGUE}: {broken} of {len(findings)} objects cannot be used; expected none"
        )


def _render(options: argparse.Namespace) -> None:
    import cv2

    from sum_drake.contact_sheet import render_contact_sheet
    from sum_drake.doctor import require_rendering
    from sum_drake.objects import load_catalogue

    check_writable(options.out)
    if options.out.exists() and not options.force:
        raise InputError(f"--out {options.out}: exists; expected a new name, or --force to replace it")
    catalogue = load_catalogue(options.catalogue)
    require_rendering()
    with anew_if_interrupted(options.out, quiet=options.quiet):
        sheet = render_contact_sheet(catalogue, progress=Counting(quiet=options.quiet))
    _, png = cv2.imencode(".png", cv2.cvtColor(sheet, cv2.COLOR_RGB2BGR))
    write_whole(options.out, png.tobytes())
    print(options.out)
