"""Links of a robot that touch each other during a motion."""

from __future__ import annotations

from dataclasses import dataclass

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.replay.simulated_robot import SimulatedRobot, import_mujoco


@dataclass(frozen=True)
class Contact:
    """Two links that overlap during a motion.

    Attributes:
        first, second: names of the links.
        depth: largest depth by which their geometry overlaps [m].
        share: of the samples in which it does, from 0 to 1.
        capsules: whether it is the capsules around the links, which are larger than the links.
    """

    first: str
    second: str
    depth: float
    share: float
    capsules: bool = False

    def __str__(self) -> str:
        time = "" if self.share == 1.0 else f", {100 * self.share:.3g} % of the time"
        return f"{self.first} and {self.second} ({1e3 * self.depth:.3g} mm{time})"


def find_contacts(robot: SimulatedRobot, postures: Array) -> tuple[Contact, ...]:
    """Pairs of links whose geometry overlaps in the configurations (k, n), deepest first.

    Neighbours in the chain are left out, as MuJoCo does, and pairs that the file excludes.
    """
    mujoco = import_mujoco()
    native, data = robot.model, mujoco.MjData(robot.model)
    contact_flag = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    before = int(native.opt.disableflags)
    depths: dict[tuple[str, str], float] = {}
    counts: dict[tuple[str, str], int] = {}
    native.opt.disableflags = before & ~contact_flag
    try:
        for q in postures:
            data.qpos[robot.positions] = q
            mujoco.mj_fwdPosition(native, data)
            touching: dict[tuple[str, str], float] = {}
            for contact in data.contact:
                if contact.dist < 0.0:
                    first, second = sorted(robot.links[geom] for geom in contact.geom)
                    deepest = touching.get((first, second), 0.0)
                    touching[first, second] = max(deepest, -float(contact.dist))
            for pair, depth in touching.items():
                depths[pair] = max(depths.get(pair, 0.0), depth)
                counts[pair] = counts.get(pair, 0) + 1
    finally:
        native.opt.disableflags = before
    found = [
        Contact(*pair, depths[pair], counts[pair] / len(postures), robot.capsules)
        for pair in depths
    ]
    return tuple(sorted(found, key=lambda contact: -contact.depth))
