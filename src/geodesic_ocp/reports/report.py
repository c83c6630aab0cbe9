"""An HTML page with a person and a robot in motion side by side, tables and the figure."""

from __future__ import annotations

import base64
import html
import io
from os import PathLike
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.reports.viewer import Actor, page, viewer
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.table import Table

# Half of the distance between the shoulders as a fraction of body height: Winter, Biomechanics and
# Motor Control of Human Movement.
_HALF_WIDTH = 0.129
_HEIGHT = 1.75  # [m], if the recording does not give it


def report(retargeting: Retargeting, file: str | PathLike[str]) -> Path:
    """Write an HTML page of a retargeting: both arms in motion, tables and the figure.

    The page needs only a browser. The robot is drawn with the meshes of its file, or as
    capsules (`Model.bodies`), rotated into the person's axes, with the paths of its hand and of the
    person's, mapped to the robot.

    Args:
        retargeting: result of `retarget`.
        file: path of the page; its folder must exist.

    Returns:
        Path of the file.

    Raises:
        OSError: the file cannot be written.
    """
    arms = retargeting.arms
    title = " and ".join(arm.title for arm in arms)
    left = all((arm.mapping.target.side or "right") == "left" for arm in arms)
    scenes = [
        ("person", [_person(arm, len(arms)) for arm in arms]),
        (" and ".join(dict.fromkeys(arm.robot.name for arm in arms)), _robots(arms)),
    ]
    moving = viewer(
        retargeting.motion.time,
        scenes,
        view=(-50.0 if left else 50.0, 22.0),
        target="the person's, mapped to the robot",
    )
    parts = [
        f"<h1>{html.escape(title[:1].upper() + title[1:])}</h1>",
        f"<p>{html.escape(_sentences(retargeting))}</p>",
        moving,
        "<h2>Compared with inverse kinematics that tracks the whole path of the hand</h2>",
        _html_table(retargeting.table()),
        "<h2>The robot's synergies, and the person's synergies from which they are made</h2>",
        _html_table(retargeting.synergy_table()),
        f'<p><img alt="hand and joints over time" src="{_picture(retargeting)}"></p>',
    ]
    target = Path(file)
    target.write_text(page(title, "\n".join(parts)), encoding="utf-8")
    return target


def _sentences(retargeting: Retargeting) -> str:
    within_limits = retargeting.settings.within_limits
    held = "within the robot's limits" if within_limits else "without limits"
    formulation = retargeting.settings.formulation
    description = {
        "constrained": "Each synergy is the path of least energy to the hand pose at its end, "
        f"{held}.",
        "geodesic": "Each synergy is the geodesic that brings the hand nearest to the pose at the "
        "person's; joint limits are not considered.",
    }[formulation]
    stretch = retargeting.stretch
    time = (
        f"The robot takes {stretch:.2f} times as long as the person, because of joint speed limits."
        if stretch > 1.0
        else "The robot takes the person's time."
    )
    num_unreachable = sum(len(arm.out_of_reach) for arm in retargeting.arms)
    reach = f" Poses out of reach: {num_unreachable}." if num_unreachable else ""
    return f"{description} {time}{reach}"


def _shoulder(arm: RetargetedArm, count: int) -> Array:
    """Position of the person's shoulder in the scene: at the origin, or to one side of it."""
    if count == 1:
        return np.zeros(3)
    height = arm.analysis.motion.subject.height or _HEIGHT
    side = -1.0 if "left" in arm.analysis.model.name else 1.0
    return np.array([side * _HALF_WIDTH * height, 0.0, 0.0])


def _person(arm: RetargetedArm, count: int) -> Actor:
    position = _shoulder(arm, count)
    model = arm.analysis.model
    return Actor(model.name, model, arm.analysis.motion.q, position=position)


def _robots(arms: tuple[RetargetedArm, ...]) -> list[Actor]:
    """Each robot with its shoulder at that of the person; two arms of one robot share its body."""
    frames = [{str(frame.name) for frame in arm.robot.pin.frames} for arm in arms]
    shoulders = np.array([np.asarray(arm.mapping.target.shoulder) for arm in arms])
    are_distinct = len(np.unique(shoulders.round(6), axis=0)) == len(arms)
    one_body = len(arms) > 1 and are_distinct and all(names == frames[0] for names in frames)
    middle = shoulders.mean(axis=0)
    actors = []
    for number, arm in enumerate(arms):
        back = np.asarray(arm.mapping.target.base).T
        if one_body:
            position = -back @ middle
        else:
            position = _shoulder(arm, len(arms)) - back @ np.asarray(arm.mapping.target.shoulder)
        others = [other.robot for other in arms[:number] if one_body]
        later = [other.robot for other in arms[number + 1 :] if one_body]
        hidden = {name for name in frames[number] if any(robot.moves(name) for robot in later)}
        if others:  # the first of which shows the body
            hidden = {name for name in frames[number] if not arm.robot.moves(name)}
        actors.append(
            Actor(
                arm.robot.name,
                arm.robot,
                arm.motion.q,
                back,
                position,
                target=arm.target_poses[1] @ back.T + position,
                hidden=frozenset(hidden),
            )
        )
    return actors


def _html_table(table: Table) -> str:
    """A table as HTML."""
    header, *rows = table.shown()
    head = "".join(f"<th>{html.escape(entry)}</th>" for entry in header)
    body = "".join(
        f"<tr>{''.join(f'<td>{html.escape(entry)}</td>' for entry in row)}</tr>" for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _picture(retargeting: Retargeting) -> str:
    """The figure as a data URL."""
    data = io.BytesIO()
    retargeting.plot().savefig(data, format="png", dpi=110)
    return f"data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}"
