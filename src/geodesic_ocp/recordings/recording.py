"""Recording: a motion of a person, with the model of the person's arm."""

from __future__ import annotations

from dataclasses import dataclass

from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.markers.marker_fit import MarkerFit
from geodesic_ocp.trajectory.motion import Motion


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """A recorded motion, with the model of the arm that moved.

    Attributes:
        model: the arm, scaled to the person.
        motion: of the model's joints, with velocities (`Motion.filtered`).
        name: of the recording, such as the name of its file.
        subject: identifies the person; recordings of equal subjects are not independent.
        fit: to markers, from which the motion was obtained; None for other recordings.

    Raises:
        ValueError: the motion lacks a joint of the model, or has no velocities.
    """

    model: Model
    motion: Motion
    name: str = ""
    subject: str = ""
    fit: MarkerFit | None = None

    def __post_init__(self) -> None:
        motion = self.motion.select(self.model.joint_names)
        if motion.velocity is None:
            raise ValueError(f"{self.name or 'motion'}: no velocities; use motion.filtered()")
        object.__setattr__(self, "motion", motion)
        object.__setattr__(self, "subject", self.subject or motion.subject.name or self.name)

    def __repr__(self) -> str:
        return f"Recording({self.name!r} of {self.subject!r}, {self.model.name}, {self.motion!r})"
