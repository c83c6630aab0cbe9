"""Analysis: a recorded motion, its geodesic synergies, and the baselines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

from geodesic_ocp.figures import overview
from geodesic_ocp.figures.new_figure import new_figure, save_figure
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import write_together
from geodesic_ocp.synergies.scores.evaluate import MotionErrors
from geodesic_ocp.synergies.synergy import Synergy
from geodesic_ocp.synergies.synergy_files import save_synergies
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.motion import Motion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LABELS = {
    "riemannian": "geodesics (Riemannian)",
    "euclidean": "straight lines, zero-velocity segments",
    "euclidean_same_segments": "straight lines, same segments",
    "ik": "inverse kinematics of the hand",
}


@dataclass(frozen=True, eq=False, repr=False)
class Analysis:
    """A recorded motion, its geodesic synergies (see `Synergy`), and the baselines.

    Attributes:
        model: the arm.
        motion: the observed motion, filtered.
        threshold: of the segmentation [rad].
        segments: (start, stop) sample indices of the geodesic segmentation.
        synergies: one for each segment.
        predicted: the motion that the synergies predict.
        segment_counts: number of segments by method, for the methods that have segments.
        predictions: predicted motion by method.
        errors: mean errors by method: "riemannian"; "euclidean", straight lines on zero-velocity
            segments (the paper's comparison); "euclidean_same_segments", straight lines on the
            geodesic segments (the like-for-like comparison); "ik", inverse kinematics of the hand.
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

    def __repr__(self) -> str:
        duration = self.motion.time[-1] - self.motion.time[0]
        errors = self.errors["riemannian"]
        return (
            f"Analysis({self.model.name}, {duration:.3f} s, {len(self.synergies)} geodesic "
            f"synergies at a threshold of {self.threshold:g} rad,\n  {errors})"
        )

    def _repr_markdown_(self) -> str:
        return self.table().markdown()

    def table(self) -> Table:
        """Number of segments and mean errors of all methods."""
        header = ("method", "segments", "joints [rad]", "hand [m]", "hand [rad]")
        rows = []
        for method, label in _LABELS.items():
            errors = self.errors[method]
            count = self.segment_counts.get(method, "-")
            rows.append((label, count, errors.joint, errors.position, errors.orientation))
        return Table(header, tuple(rows))

    def plot(self) -> Figure:
        """Hand and three joints over time, observed and predicted, and the path of the hand."""
        figure = new_figure(11.0, 7.5)
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
            for joint in overview.widest_of_thirds(self.motion.q)
        ]
        overview.draw_overview(figure, time, self.segments, hands, joints)
        figure.suptitle(
            f"{self.model.name}: {len(self.segments)} geodesic synergies "
            f"(threshold {self.threshold:g} rad)"
        )
        return figure

    def save(self, folder: str | FilePath) -> list[FilePath]:
        """Write table.csv, table.md, figure.png, figure.pdf and synergies.json to the folder.

        All are written to a temporary folder first and moved together; `load_synergies` reads the
        last.

        Returns:
            The files' paths.

        Raises:
            OSError: the folder cannot be created or written to.
        """
        return write_together(folder, self._write)

    def _write(self, folder: FilePath) -> None:
        table = self.table()
        (folder / "table.csv").write_text(table.csv(), encoding="utf-8")
        (folder / "table.md").write_text(table.markdown(), encoding="utf-8")
        save_figure(self.plot(), folder)
        save_synergies(folder / "synergies.json", self.synergies, self.motion.joint_names)
