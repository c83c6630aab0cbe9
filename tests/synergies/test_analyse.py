"""Analyses of the bundled recording, and of recordings of the KIT motion database."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from shaded_times import is_shaded

import geodesic_ocp as go

METHODS = ["riemannian", "euclidean", "euclidean_same_segments", "ik"]


def test_everything_is_there(bundled_analysis: go.Analysis) -> None:
    assert list(bundled_analysis.errors) == METHODS
    assert len(bundled_analysis.segments) == len(bundled_analysis.synergies)
    assert bundled_analysis.segments[0][0] == 0
    assert bundled_analysis.segments[-1][1] == len(bundled_analysis.motion) - 1
    assert bundled_analysis.predicted is bundled_analysis.predictions["riemannian"]
    assert bundled_analysis.motion.velocity is not None
    assert bundled_analysis.segment_counts["euclidean_same_segments"] == len(
        bundled_analysis.segments
    )
    again = go.evaluate(bundled_analysis.model, bundled_analysis.motion, bundled_analysis.predicted)
    assert again == bundled_analysis.errors["riemannian"]


def test_errors_are_small_against_the_motion(bundled_analysis: go.Analysis) -> None:
    hand = bundled_analysis.model.hand_pose(bundled_analysis.motion.q)[1]
    path = np.linalg.norm(np.diff(hand, axis=0), axis=1).sum()
    assert bundled_analysis.errors["riemannian"].position < 0.02 * path
    assert bundled_analysis.errors["ik"].position < 0.002
    for synergy in bundled_analysis.synergies:
        ends = bundled_analysis.motion.q[[synergy.start, synergy.stop]]
        assert bundled_analysis.predicted.q[[synergy.start, synergy.stop]] == pytest.approx(
            ends, abs=1e-9
        )


@pytest.mark.slow
def test_finer_thresholds_explain_more(bundled_analysis: go.Analysis) -> None:
    model, whole = bundled_analysis.model, bundled_analysis.motion
    metric = go.KineticEnergy(model)
    reach = slice(260, 430)
    motion = go.Motion(whole.time[reach], whole.q[reach], whole.joint_names, whole.velocity[reach])
    coarse, fine = (go.segment(metric, motion, threshold) for threshold in (0.6, 0.3))
    assert len(fine) > len(coarse)
    errors = [
        go.evaluate(model, motion, go.reconstruct(metric, motion, segments).predicted).joint
        for segments in (coarse, fine)
    ]
    assert errors[1] < errors[0]


def test_table_shows_both_comparisons(bundled_analysis: go.Analysis) -> None:
    table = bundled_analysis.table()
    assert len(table.rows) == 4
    assert [row[1] for row in table.rows] == [
        len(bundled_analysis.segments),
        bundled_analysis.segment_counts["euclidean"],
        len(bundled_analysis.segments),
        "-",
    ]
    text = str(table)
    assert "straight lines, zero-velocity segments" in text
    assert "straight lines, same segments" in text
    assert f"{bundled_analysis.errors['riemannian'].joint:#.3g}" in text


def test_figure_has_its_panels(bundled_analysis: go.Analysis) -> None:
    figure = bundled_analysis.plot()
    assert isinstance(figure, Figure)
    labels = [axes.get_ylabel().replace("\n", " ") for axes in figure.axes]
    assert len(labels) == 6
    assert sum(label.startswith("hand") and "[m]" in label for label in labels) == 3
    joints = [label for label in labels if "[rad]" in label]
    assert [label[:2] for label in joints] == ["LS", "LE", "LW"]
    time = bundled_analysis.motion.time - bundled_analysis.motion.time[0]
    middles = time[np.array(bundled_analysis.segments)].mean(axis=1)
    for axes in figure.axes[:5]:
        observed, predicted = axes.get_lines()
        assert len(observed.get_xdata()) == len(bundled_analysis.motion)
        assert not np.array_equal(observed.get_ydata(), predicted.get_ydata())
        assert is_shaded(axes, middles).tolist() == [k % 2 == 0 for k in range(middles.size)]


def test_saved_results_can_be_loaded(bundled_analysis: go.Analysis, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "results"
    folder.mkdir(parents=True)
    (folder / "table.md").write_text("of an older analysis, to be replaced")
    files = bundled_analysis.save(folder)
    expected = ["figure.pdf", "figure.png", "synergies.json", "table.csv", "table.md"]
    assert [file.name for file in files] == expected
    assert sorted(file.name for file in folder.iterdir()) == expected
    assert (folder / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "figure.pdf").read_bytes().startswith(b"%PDF")
    assert (folder / "table.md").read_text() == bundled_analysis.table().markdown()
    rows = list(csv.reader((folder / "table.csv").read_text().splitlines()))
    assert float(rows[1][2]) == bundled_analysis.errors["riemannian"].joint
    loaded = go.load_synergies(folder / "synergies.json", go.KineticEnergy(bundled_analysis.model))
    t = bundled_analysis.motion.time
    for synergy in loaded:
        here = slice(synergy.start, synergy.stop)
        assert np.array_equal(synergy(t[here]), bundled_analysis.predicted.q[here])


def test_a_failed_save_leaves_nothing_half_written(
    bundled_analysis: go.Analysis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(self: Figure, *arguments: object, **options: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(Figure, "savefig", fail)
    with pytest.raises(OSError, match="disk full"):
        bundled_analysis.save(tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_progress_runs_to_its_end(bundled_file: Path) -> None:
    seen: list[tuple[str, int, int]] = []
    arm = go.human_arm("left")
    motion = go.read_motion(bundled_file, arm.joint_names)
    short = go.Motion(motion.time[740:], motion.q[740:], motion.joint_names)
    go.analyse(arm, short, progress=lambda *report: seen.append(report))
    assert seen[0][0] == "cutting into segments"
    assert seen[-1][1] == seen[-1][2] > 0
    assert [done for _, done, _ in seen] == sorted(done for _, done, _ in seen)


def test_repr_is_short_and_notebooks_show_the_table(bundled_analysis: go.Analysis) -> None:
    lines = repr(bundled_analysis).splitlines()
    assert len(lines) == 2
    assert f"{len(bundled_analysis.synergies)} geodesic synergies" in lines[0]
    assert repr(bundled_analysis.errors["riemannian"]) in lines[1]
    assert bundled_analysis._repr_markdown_() == bundled_analysis.table().markdown()


def test_mistakes_are_named(bundled_file: Path, bundled_analysis: go.Analysis) -> None:
    motion = go.read_motion(bundled_file)
    with pytest.raises(ValueError, match="there is no joint RSx_joint"):
        go.analyse(go.human_arm("right"), motion)
    with pytest.raises(ValueError, match="threshold must be positive"):
        go.analyse(bundled_analysis.model, motion, threshold=0.0)
    short = go.Motion(motion.time[:10], motion.q[:10], motion.joint_names)
    with pytest.raises(ValueError, match="window 21 needs as many samples, not 10"):
        go.analyse(bundled_analysis.model, short)
    degrees = dataclasses.replace(motion, q=np.degrees(motion.q))
    with pytest.raises(ValueError, match=r"LSx_joint is -?\d+\.\d+ at sample \d+, far outside"):
        go.analyse(bundled_analysis.model, degrees)
    jump = motion.q.copy()
    jump[200:, 4] -= 2.5
    with pytest.raises(ValueError, match=r"LEz_joint (is|jumps from)"):
        go.analyse(bundled_analysis.model, dataclasses.replace(motion, q=jump))
    still = dataclasses.replace(motion, q=np.tile(motion.q[0], (len(motion), 1)))
    with pytest.raises(ValueError, match="never moves"):
        go.analyse(bundled_analysis.model, still)


@pytest.mark.slow
def test_take_book_from_shelf(shared: Path) -> None:
    """Values of an independent implementation, to 20 %."""
    file = shared / "data" / "kit" / "take_book_from_shelf_right_arm_02.xml"
    arm = go.human_arm("right", 1.83, 100.0)
    analysis = go.analyse(arm, go.read_motion(file), threshold=0.6)
    errors = analysis.errors
    assert len(analysis.segments) == pytest.approx(20, rel=0.2)
    assert errors["riemannian"].joint == pytest.approx(0.057, rel=0.2)
    assert errors["riemannian"].position == pytest.approx(0.013, rel=0.2)
    assert errors["euclidean_same_segments"].joint == pytest.approx(0.033, rel=0.2)
    assert errors["euclidean_same_segments"].position == pytest.approx(0.029, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("hand_to_mouth_right_arm_01", "right"),
        ("hand_to_mouth_right_arm_02", "right"),
        ("take_book_from_shelf_right_arm_03", "right"),
        ("Trial_75", "right"),
        ("Trial_75", "left"),
    ],
)
def test_every_log_map_of_every_recording_converges(name: str, side: str, shared: Path) -> None:
    arm = go.human_arm(side, 1.83, 100.0)
    metric = go.KineticEnergy(arm)
    analysis = go.analyse(arm, go.read_motion(shared / "data" / "kit" / f"{name}.xml"))
    for synergy in analysis.synergies:
        start, stop = synergy.path(0.0), synergy.path(1.0)
        arrival = go.exp(metric, start, go.log(metric, start, stop), tolerance=1e-12)
        assert np.abs(arrival - stop).max() <= 1e-9
