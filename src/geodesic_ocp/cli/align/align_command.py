"""`geodesic-ocp align`: how a robot's arm is aligned with a person's, as a table and a file."""

from __future__ import annotations

import argparse
import textwrap

from geodesic_ocp.cli.notes import printed_warnings
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.retargeting.alignment.alignment import known_alignment, proposal, read_alignment
from geodesic_ocp.retargeting.alignment.alignment_figure import alignment_figure, alignment_table

_WIDTH = 100
_SUFFIX = ".json"


def align_robot(options: argparse.Namespace) -> None:
    """`geodesic-ocp align`."""
    out = options.out
    if out is not None and out.suffix != _SUFFIX:
        raise ValueError(f"--out: the file must end in {_SUFFIX}, got {out}")
    if options.alignment is not None and options.side is not None:
        raise ValueError("--side has no effect with --alignment: change side in the file")
    with printed_warnings():
        robot = load_model(options.robot, hand=options.hand, base=options.base)
    known = known_alignment(robot) if options.side is None else None
    notes: tuple[str, ...] = ()
    if options.alignment is not None:
        aligned, source = read_alignment(options.alignment), f"read from {options.alignment}"
    elif known is not None:
        aligned, source = known, f"the built-in alignment of {robot.name}"
    else:
        proposed = proposal(robot, options.side)
        aligned, notes = proposed.alignment, proposed.assumptions
        source = "taken from the kinematics, assuming that"
    print(f"{alignment_table(robot, aligned)}\n\n{source}")
    for note in notes:
        print(textwrap.fill(note, _WIDTH, initial_indent="- ", subsequent_indent="  "))
    if out is None:
        print("\n--out FILE.json writes it to a file to edit, for `retarget --alignment`")
        return
    figure = alignment_figure(robot, aligned, human_arm(aligned.side or "right"))
    out.parent.mkdir(parents=True, exist_ok=True)
    aligned.save(out, notes or (source,))
    figure.savefig(out.with_suffix(".png"), dpi=150)
    print(f"\nwrote {out}\nwrote {out.with_suffix('.png')}")
