"""The main job: from a recording to geodesic synergies, and how well they explain it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from matplotlib.figure import Figure

from geodesic_ocp.figures import plot
from geodesic_ocp.manifold.euclidean import Euclidean
from geodesic_ocp.manifold.kinetic_energy import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import write_together
from geodesic_ocp.synergies.evaluate import MotionErrors, evaluate
from geodesic_ocp.synergies.files import save_synergies
from geodesic_ocp.synergies.reconstruct import Reconstruction, Synergy, reconstruct
from geodesic_ocp.synergies.segment import segment, segment_zero_velocity
from geodesic_ocp.synergies.track_hand import track_hand
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.motion import Motion

_METHODS = {
    "riemannian": "geodesics (Riemannian)",
    "euclidean": "straight lines, zero-velocity segments",
    "euclidean_same_segments": "straight lines, same segments",
    "ik": "inverse kinematics of the hand",
}
# Recordings go past the limits by tenths; by more than this it is not a joint's angle [rad or m].
_FAR_OUTSIDE = 2.0
Progress = Callable[[str, int, int], object]


def no_progress(label: str, done: int, total: int) -> None:
    """Progress that nobody asked for."""
    del label, done, total


@dataclass(frozen=True, eq=False)
class Analysis:
    """A recording, its geodesic synergies, and the baselines.

    Attributes:
        model: the arm.
        motion: the observed motion, filtered.
        threshold: of the segmentation [rad].
        segments: (start, stop) sample indices of the geodesic segmentation.
        synergies: one for each segment.
        predicted: the motion that the synergies predict.
        segment_counts: number of segments by method, of those methods that have segments.
        predictions: predicted motion by method.
        errors: mean errors by method: "riemannian"; "euclidean", straight lines on zero-velocity
            segments (the paper's comparison); "euclidean_same_segments", straight lines on the
            geodesic segments (the fair one); "ik", inverse kinematics of the hand.
    """

    model: Model
    motion: Motion
    threshold: float
    segments: tuple[tuple[int, int], ...]
    synergies: tuple[Synergy, ...]
    predicted: Motion
    segment_counts: Mapping[str, int]
    predictions: Mapping[str, Motion]
    errors: Mapping[str, MotionErrors]

    def table(self) -> Table:
        """Numbers of segments and mean errors of all methods."""
        header = ("method", "segments", "joints [rad]", "hand [m]", "hand [rad]")
        rows = []
        for method, name in _METHODS.items():
            errors = self.errors[method]
            count = self.segment_counts.get(method, "-")
            rows.append((name, count, errors.joint, errors.position, errors.orientation))
        return Table(header, tuple(rows))

    def plot(self) -> Figure:
        """Hand and three joints over time, observed and predicted, and the hand's path."""
        figure = Figure(figsize=(11.0, 7.5), layout="constrained")
        time = self.motion.time - self.motion.time[0]
        hands = (
            self.model.hand_pose(self.motion.q)[1],
            self.model.hand_pose(self.predicted.q)[1],
        )
        joints = [
            (
                f"{self.model.joint_names[joint].removesuffix('_joint')}\n[rad]",
                self.motion.q[:, joint],
                self.predicted.q[:, joint],
            )
            for joint in plot.widest_of_thirds(self.motion.q)
        ]
        plot.draw_overview(figure, time, self.segments, hands, joints)
        figure.suptitle(
            f"{self.model.name}: {len(self.segments)} geodesic synergies "
            f"(threshold {self.threshold:g} rad)"
        )
        return figure

    def save(self, folder: str | FilePath) -> list[FilePath]:
        """Write table.csv, table.md, figure.png, figure.pdf and synergies.json to the folder.

        All are written elsewhere first and moved in together; `load_synergies` reads the last.

        Returns:
            The files' paths.

        Raises:
            OSError: the folder cannot be made or written to.
        """
        return write_together(folder, self._write)

    def _write(self, made: FilePath) -> None:
        table, figure = self.table(), self.plot()
        (made / "table.csv").write_text(table.csv(), encoding="utf-8")
        (made / "table.md").write_text(table.markdown(), encoding="utf-8")
        figure.savefig(made / "figure.png", dpi=150)
        figure.savefig(made / "figure.pdf")
        save_synergies(made / "synergies.json", self.synergies, self.motion.joint_names)


def _plausible(model: Model, motion: Motion) -> None:
    """ValueError where a joint is far outside its limits, or jumps: other units, or a spike."""
    for joint, q in zip(model.joint_names, motion.q.T, strict=True):
        index = model.joint_names.index(joint)
        low, high = model.lower[index], model.upper[index]
        outside = np.maximum(low - q, q - high)
        worst, jump = int(np.argmax(outside)), int(np.argmax(np.abs(np.diff(q))))
        if outside[worst] > _FAR_OUTSIDE:
            raise ValueError(
                f"{joint} is {q[worst]:.6g} at sample {worst}, far outside its limits "
                f"{low:.3g} to {high:.3g}: another unit, or a spike?"
            )
        if abs(q[jump + 1] - q[jump]) > _FAR_OUTSIDE:
            raise ValueError(f"{joint} jumps from {q[jump]:.6g} to {q[jump + 1]:.6g} at {jump}")


def analyse(
    model: Model, motion: Motion, threshold: float = 0.6, *, progress: Progress | None = None
) -> Analysis:
    """Cut a recorded motion into geodesic synergies, plan each, and compare with the baselines.

    Args:
        model: the arm; its joints are picked from the motion by name.
        motion: the recording; filtered here (`Motion.filtered`) if it has no velocities.
        threshold: of the segmentation [rad], see `segment`.
        progress: called with what is being done, how much is done and how much there is.

    Raises:
        ValueError: a joint is missing, jumps or lies far outside its limits, the motion never
            moves or is too short to filter, or the threshold is out of range.
        NotConverged: no geodesic was found for a segment.
    """
    report = progress or no_progress
    motion = motion.select(model.joint_names)
    _plausible(model, motion)
    if motion.velocity is None:
        motion = motion.filtered()
    metric, flat = KineticEnergy(model), Euclidean(model.dof)
    report("cutting into segments", 0, 1)
    segments = segment(metric, motion, threshold)
    by_velocity = segment_zero_velocity(motion, joints=min(3, model.dof - 1))
    total = 2 * len(segments) + len(by_velocity) + 1

    before = 0
    found: dict[str, Reconstruction] = {}
    for method, its_metric, its_segments, label in (
        ("riemannian", metric, segments, "planning geodesics"),
        ("euclidean_same_segments", flat, segments, "planning straight lines"),
        ("euclidean", flat, by_velocity, "planning straight lines"),
    ):

        def advance(done: int, label: str = label, before: int = before) -> None:
            report(label, before + done, total)

        found[method] = reconstruct(its_metric, motion, its_segments, progress=advance)
        before += len(its_segments)
    report("following the hand", before, total)
    predictions = {method: found[method].predicted for method in found}
    predictions["ik"] = track_hand(model, motion)
    report("done", total, total)
    return Analysis(
        model=model,
        motion=motion,
        threshold=float(threshold),
        segments=tuple(segments),
        synergies=found["riemannian"].synergies,
        predicted=found["riemannian"].predicted,
        segment_counts={method: len(found[method].synergies) for method in found},
        predictions=predictions,
        errors={method: evaluate(model, motion, predictions[method]) for method in _METHODS},
    )
