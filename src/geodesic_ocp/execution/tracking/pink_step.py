"""A step of inverse kinematics by the package pink, on the same tasks and bounds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.tracking.step import Step, Weights
from geodesic_ocp.model.model import Model

_SOLVER = "daqp"


def pink_step(
    model: Model, rows: tuple[int, ...], duration: float, weights: Weights
) -> Callable[[Step], Array]:
    """A function that solves steps [s] with pink's tasks, and its QP by DAQP.

    FrameTask is given the pose that the hand reaches within the step at the wanted velocity. Bounds
    of the speeds stand in a Limit. (Those of pink's own AccelerationLimit can contradict each other
    near the end of a joint's range, as they count the room for braking before the step, not after.)

    Raises:
        ImportError: without the extra "pink".
    """
    try:
        from pink import Configuration, solve_ik
        from pink.limits import Limit
        from pink.tasks import FrameTask, LowAccelerationTask, PostureTask
        from qpsolvers import available_solvers
    except ImportError as error:
        raise ImportError(
            "inverse kinematics by pink needs: pip install 'geodesic_ocp[pink]'"
        ) from error
    if _SOLVER not in available_solvers:
        raise ImportError("pink's QPs need DAQP: pip install 'geodesic_ocp[pink]'")

    class Bounds(Limit):  # type: ignore[misc, unused-ignore]
        """Least and largest displacements of all joints."""

        lower: Array
        upper: Array

        def compute_qp_inequalities(self, configuration: Any, dt: float) -> tuple[Array, Array]:
            del configuration, dt
            both = np.concatenate([self.upper, -self.lower])
            eye = np.eye(self.upper.size)
            finite = np.isfinite(both)
            return np.vstack([eye, -eye])[finite], both[finite]

    chain = model.pin.copy()  # pink adds attributes to it
    data = chain.createData()
    placed, turned = (float(first in rows) for first in (0, 3))
    hand = FrameTask(model.hand, position_cost=placed, orientation_cost=turned)
    posture = PostureTask(cost=float(np.sqrt(weights.posture)))
    change = LowAccelerationTask(cost=float(np.sqrt(weights.change)))
    bounds = Bounds()

    def solve(step: Step) -> Array:
        way = np.zeros(6)
        way[list(rows)] = duration * step.velocity
        configuration = Configuration(chain, data, step.q, copy_data=False)
        pose = configuration.get_transform_frame_to_world(model.hand)
        pose.rotation = Rotation.from_rotvec(way[3:]).as_matrix() @ pose.rotation
        pose.translation = pose.translation + way[:3]
        hand.set_target(pose)
        posture.set_target(step.q + duration * step.posture)
        change.set_last_integration(step.before, duration)
        bounds.lower, bounds.upper = duration * step.lower, duration * step.upper
        return np.asarray(
            solve_ik(
                configuration,
                [hand, posture, change],
                duration,
                _SOLVER,
                damping=step.damping,
                limits=[bounds],
                safety_break=False,
            )
        )

    return solve
