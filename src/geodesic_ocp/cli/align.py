"""geodesic-ocp align: how a robot's arm is aligned with a person's, as a table and a file."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.cli.options import with_hand_of
from geodesic_ocp.cli.terminal import print_written, printed_warnings
from geodesic_ocp.drawing.alignments import alignment_figure
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.arm_alignment import (
    Alignment,
    check_joints,
    known_alignment,
    proposal,
    read_alignment,
)
from geodesic_ocp.retargeting.landmarks import axis_name
from geodesic_ocp.tables import new_table, text

if TYPE_CHECKING:
    from pandas import DataFrame

_WIDTH = 100
_SUFFIX = ".json"


def align(
    robot: str,
    /,
    *,
    hand: str | None = None,
    base: str | None = None,
    side: Side | None = None,
    alignment: Path | None = None,
    out: Path | None = None,
) -> None:
    """Show and save how a robot's arm is aligned with a person's.

    Args:
        robot: name, or URDF, MJCF or MMM file.
        hand: hand (end-effector) frame.
        base: fixed frame that becomes the base.
        side: side of the body, which chooses the hand of one with two; default: where the shoulder
            is.
        alignment: file of an alignment, as edited, to show instead.
        out: file to edit (.json), beside which a figure (.png) is written.
    """
    if out is not None and out.suffix != _SUFFIX:
        raise ValueError(f"--out: the file must end in {_SUFFIX}, got {out}")
    if alignment is not None and side is not None:
        raise ValueError("--side has no effect with --alignment: change side in the file")
    with printed_warnings():
        model = load_model(robot, hand=hand, base=base)
    given = None if alignment is None else read_alignment(alignment)
    model = with_hand_of(model, side if given is None else given.side)
    known = known_alignment(model) if side is None or len(model.hands) == 2 else None
    notes: tuple[str, ...] = ()
    if given is not None:
        check_joints(given, model)
        aligned = given
        source = f"read from {alignment}"
    elif known is not None:
        aligned = known
        source = f"the built-in alignment of {model.name}"
    else:
        aligned, notes = proposal(model, side)
        source = "taken from the kinematics, assuming that"
    print(f"{text(_table(model, aligned))}\n\n{source}")
    for note in notes:
        print(textwrap.fill(note, _WIDTH, initial_indent="- ", subsequent_indent="  "))
    if out is None:
        print("\n--out FILE.json writes it to a file to edit, for `retarget --alignment`")
        return
    figure = alignment_figure(model, aligned, human_arm(aligned.side or "right"))
    out.parent.mkdir(parents=True, exist_ok=True)
    aligned.save(out, notes or (source,))
    figure.savefig(out.with_suffix(".png"), dpi=150)
    print()
    print_written([out, out.with_suffix(".png")])


def _table(robot: Model, aligned: Alignment) -> DataFrame:
    """Return shoulder, axes, length, side, elbow and wrist of an alignment, in words."""
    base = np.asarray(aligned.base)
    hand = np.asarray(aligned.hand)
    across = {"right": "back of the hand", "left": "palm"}.get(aligned.side or "", "hand's right")
    position = ", ".join(f"{entry:.3f}" for entry in np.asarray(aligned.shoulder) + 0.0)
    rows = (
        ("shoulder", f"at ({position}) m in the base frame"),
        ("person's right", axis_name(base[:, 0], "the base")),
        ("person's forward", axis_name(base[:, 1], "the base")),
        ("person's up", axis_name(base[:, 2], "the base")),
        ("fingers", axis_name(hand[2], robot.hand)),
        (across, axis_name(hand[0], robot.hand)),
        ("length", f"{aligned.length:.3f} m from the shoulder to the hand"),
        ("side", aligned.side or "either"),
        ("elbow", aligned.elbow or "not known"),
        ("wrist", aligned.wrist or "not known"),
    )
    return new_table(("alignment", robot.name), rows)
