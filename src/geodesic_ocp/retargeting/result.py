"""What `retarget` returns: a robot's synergies and motion, figures, tables and files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath

from matplotlib.figure import Figure

from geodesic_ocp.figures import plot
from geodesic_ocp.records import write_together
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.retargeting.time_scaling import Timing
from geodesic_ocp.synergies.files import save_synergies
from geodesic_ocp.synergies.reconstruct import Synergy
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.joint_trajectory import Trajectory
from geodesic_ocp.trajectory.motion import Motion

_METHODS = {"synergies": "geodesic synergies", "ik": "inverse kinematics"}


@dataclass(frozen=True, eq=False)
class Retargeting:
    """A person's synergies on a robot, or on several arms at once.

    Attributes:
        arms: what became of each; as a rule there is one.
        timing: the robot's time over the recording's, with the factors by which it is stretched.
        formulation: in which the paths were sought.
        limits: whether joints were kept within their limits.
        seconds: that it took.
    """

    arms: tuple[RetargetedArm, ...]
    timing: Timing
    formulation: str
    limits: bool
    seconds: float

    @property
    def synergies(self) -> tuple[Synergy, ...]:
        """The robot's synergies, of all arms, one arm after the other."""
        return tuple(synergy for arm in self.arms for synergy in arm.synergies)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Of all arms; where two have a name in common, with the arm's number in front."""
        names = [name for arm in self.arms for name in arm.robot.joint_names]
        if len(set(names)) == len(names):
            return tuple(names)
        return tuple(
            f"{number}/{name}"
            for number, arm in enumerate(self.arms)
            for name in arm.robot.joint_names
        )

    @cached_property
    def trajectory(self) -> Trajectory:
        """Positions, velocities and accelerations of all joints."""
        return Trajectory.side_by_side([arm.trajectory for arm in self.arms], self.joint_names)

    @cached_property
    def motion(self) -> Motion:
        """The robot's motion, all joints, at the recording's samples, in the robot's time."""
        found = self.trajectory
        return Motion(found.time, found.positions, found.joint_names, found.velocities)

    @property
    def stretch(self) -> float:
        """The whole duration over the person's; 1 where no joint was too fast."""
        edges = self.timing.edges
        return float(self.timing(edges[-1:])[0] / (edges[-1] - edges[0]))

    def table(self) -> Table:
        """Energy, speed and the hand's errors of the synergies and of inverse kinematics."""
        header = (
            "arm",
            "method",
            "energy [J s]",
            "peak speed [limit]",
            "hand, mean [m]",
            "hand, mean [rad]",
            "outside limits [rad or m]",
        )
        rows = [
            (
                arm.title,
                _METHODS[method],
                found.energy,
                found.peak_speed if arm.has_speed_limits else "-",
                found.position,
                found.orientation,
                found.outside,
            )
            for arm in self.arms
            for method, found in arm.figures.items()
        ]
        return Table(header, tuple(rows))

    def synergy_table(self) -> Table:
        """The robot's synergies beside those of the person that they are made of."""
        header = (
            "arm",
            "synergy",
            "of the person's",
            "dropped",
            "kind",
            "start [s]",
            "duration [s]",
            "stretched by",
            "length [kg^1/2 m]",
            "miss [m]",
            "miss [rad]",
            "iterations",
            "status",
        )
        rows: list[tuple[str | int | float, ...]] = []
        for arm in self.arms:
            time = arm.analysis.motion.time
            for number, (group, synergy, transfer) in enumerate(
                zip(arm.groups, arm.synergies, arm.transfers, strict=True)
            ):
                seconds = float(time[group.stop] - time[group.start])
                rows.append(
                    (
                        arm.robot.name,
                        number,
                        _span(group.members),
                        _span(group.dropped),
                        group.kind,
                        synergy.start_time,
                        synergy.duration,
                        synergy.duration / seconds,
                        synergy.length,
                        "-" if group.kind == "rest" else transfer.position_error,
                        "-" if group.kind == "rest" else transfer.rotation_error,
                        transfer.iterations,
                        transfer.status,
                    )
                )
        return Table(header, tuple(rows))

    def plot(self) -> Figure:
        """Hand and three joints over time, and the hand's path, of every arm.

        The person's hand, carried over, beside the robot's; spans of the robot's synergies are
        shaded, and marks on the upper edge tell where the person's began. Joints are those of the
        robot, beside what inverse kinematics does.
        """
        count = len(self.arms)
        figure = Figure(figsize=(11.0, 7.5 * count), layout="constrained")
        parts = figure.subfigures(count, 1, squeeze=False)[:, 0]
        for arm, part in zip(self.arms, parts, strict=True):
            time = arm.trajectory.time
            segments = [(group.start, group.stop) for group in arm.groups]
            hands = (arm.wanted[1], arm.robot.hand_pose(arm.motion.q)[1])
            joints = []
            for joint in plot.widest_of_thirds(arm.motion.q):
                name, unit = arm.robot.joint_names[joint], arm.robot.units[joint]
                label = f"{_short(name)}\n[{unit}]"
                joints.append((label, arm.baseline.q[:, joint], arm.motion.q[:, joint]))
            ticks = time[[synergy.start for synergy in arm.analysis.synergies]]
            names, other = ("person's hand, carried over", "geodesic synergies"), _METHODS["ik"]
            plot.draw_overview(part, time, segments, hands, joints, names, other, ticks)
            part.suptitle(
                f"{arm.title}: {len(arm.groups)} synergies of {len(arm.analysis.synergies)}"
            )
        return figure

    def save(self, folder: str | FilePath) -> list[FilePath]:
        """Write tables, figure, synergies and trajectory to the folder.

        The trajectory begins and ends at the person's speed (`retarget(..., rest=True)`: at rest,
        as many controllers ask for). Its velocities jump where synergies meet, as directions do,
        and its accelerations are those between, rough to about a hundredth where a limit holds a
        path back: the path is a polynomial in pieces.

        table.csv and table.md, synergies.csv and synergies.md (`synergy_table`), figure.png and
        figure.pdf, trajectory.csv, trajectory.json (the message JointTrajectory of ROS 2), and for
        each arm synergies.json, or synergies_0.json and so on.

        Returns:
            The files' paths.

        Raises:
            OSError: the folder cannot be made or written to.
        """
        return write_together(folder, self._write)

    def _write(self, made: FilePath) -> None:
        for name, table in (("table", self.table()), ("synergies", self.synergy_table())):
            (made / f"{name}.csv").write_text(table.csv(), encoding="utf-8")
            (made / f"{name}.md").write_text(table.markdown(), encoding="utf-8")
        (made / "trajectory.csv").write_text(self.trajectory.csv(), encoding="utf-8")
        (made / "trajectory.json").write_text(self.trajectory.json(), encoding="utf-8")
        figure = self.plot()
        figure.savefig(made / "figure.png", dpi=150)
        figure.savefig(made / "figure.pdf")
        for number, arm in enumerate(self.arms):
            name = "synergies.json" if len(self.arms) == 1 else f"synergies_{number}.json"
            save_synergies(made / name, arm.synergies, arm.robot.joint_names)


def _span(numbers: tuple[int, ...]) -> str:
    """Numbers as a text: "3", "3-5", "3, 5", or "-" for none."""
    parts: list[str] = []
    first = last = None
    for number in (*numbers, None):
        if last is not None and number == last + 1:
            last = number
            continue
        if first is not None:
            parts.append(f"{first}" if first == last else f"{first}-{last}")
        first = last = number
    return ", ".join(parts) or "-"


def _short(name: str) -> str:
    return name.removesuffix("_joint").removeprefix("panda_")
