"""Analyses of the bundled recording, and of recordings of the KIT motion database."""

from __future__ import annotations

import csv
import dataclasses
import importlib
import itertools
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from known_models import planar_arm
from matplotlib.figure import Figure
from motion_files import motion_in
from shaded_times import is_shaded
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.manifold.metrics import FRACTION
from geodesic_ocp.tables import markdown, text

synergy_module = importlib.import_module("geodesic_ocp.synergies.synergy")
TABLES = ["table.csv", "table.md", "table_unfiltered.csv", "table_unfiltered.md"]
METHODS = ["riemannian", "kinetic_energy", "euclidean_same_segments", "euclidean", "ik"]


@pytest.mark.slow
def test_everything_is_there(bundled_analysis: go.synergies.Analysis) -> None:
    assert sorted(bundled_analysis.errors) == sorted(METHODS)
    assert bundled_analysis.not_found == ()
    assert len(bundled_analysis.segments) == len(bundled_analysis.synergies)
    assert bundled_analysis.segments[0][0] == 0
    assert bundled_analysis.segments[-1][1] == len(bundled_analysis.motion) - 1
    assert bundled_analysis.predicted is bundled_analysis.predictions["riemannian"]
    assert bundled_analysis.motion.velocity is not None
    assert bundled_analysis.segment_counts["euclidean_same_segments"] == len(
        bundled_analysis.segments
    )
    again = go.synergies.motion_errors(
        bundled_analysis.model, bundled_analysis.motion, bundled_analysis.predicted
    )
    assert again == bundled_analysis.errors["riemannian"]


def test_errors_are_small_against_the_motion(bundled_analysis: go.synergies.Analysis) -> None:
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
def test_finer_thresholds_explain_more(bundled_analysis: go.synergies.Analysis) -> None:
    model, motion, metric = bundled_analysis.model, bundled_analysis.motion, bundled_analysis.metric
    coarse, fine = (go.segment(metric, motion, threshold) for threshold in (0.6, 0.3))
    assert len(fine) > len(coarse)
    errors = [
        go.synergies.motion_errors(
            model, motion, go.synergies.reconstruct(metric, motion, segments).predicted
        ).joint
        for segments in (coarse, fine)
    ]
    assert errors[1] < errors[0]


def test_table_shows_all_comparisons(bundled_analysis: go.synergies.Analysis) -> None:
    table = bundled_analysis.table()
    count = len(bundled_analysis.segments)
    counts = [count, count, count, bundled_analysis.segment_counts["euclidean"], None]
    assert [row[1] for row in rows_of_table(table)] == counts
    assert [row[2] for row in rows_of_table(table)] == [
        bundled_analysis.errors[method].joint for method in METHODS
    ]
    shown = text(table)
    assert "straight lines, zero-velocity segments" in shown
    assert "straight lines, same segments" in shown
    assert f"{bundled_analysis.errors['riemannian'].joint:#.3g}" in shown


@pytest.mark.slow
def test_figure_has_its_panels(bundled_analysis: go.synergies.Analysis) -> None:
    pytest.importorskip("geodesic_ocp.drawing")
    figure = go.plot(bundled_analysis, curve=lambda axes: axes.set_title("curve", loc="right"))
    assert isinstance(figure, Figure)
    strip, joints, hand, path, curve = figure.axes
    assert curve.get_title("right") == "curve"
    time = bundled_analysis.motion.time - bundled_analysis.motion.time[0]
    middles = time[np.array(bundled_analysis.segments)].mean(axis=1)
    wanted = {"riemannian": 0, "kinetic_energy": 1, "euclidean_same_segments": 2}
    for axes, of, scale in ((joints, "joint", 1.0), (hand, "position", 1000.0)):
        for method, line in wanted.items():
            drawn = axes.get_lines()[line].get_ydata()
            expected = scale * getattr(bundled_analysis.errors[method], of)
            assert np.mean(drawn) == pytest.approx(expected)
        assert is_shaded(axes, middles).tolist() == [k % 2 == 0 for k in range(middles.size)]
    assert len(path.get_lines()[0].get_xdata()) == len(bundled_analysis.motion)
    assert len([text for text in strip.texts if text.get_text().endswith(" s")]) > 5


@pytest.mark.slow
def test_saved_results_can_be_loaded(
    bundled_analysis: go.synergies.Analysis, tmp_path: Path
) -> None:
    folder = tmp_path / "new" / "results"
    folder.mkdir(parents=True)
    (folder / "table.md").write_text("of an older analysis, to be replaced")
    files = bundled_analysis.save(folder)
    expected = ["figure.pdf", "figure.png", "second_order.csv", "second_order.md"]
    expected += ["synergies.json", *TABLES]
    assert [file.name for file in files] == expected
    assert sorted(file.name for file in folder.iterdir()) == expected
    assert (folder / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "figure.pdf").read_bytes().startswith(b"%PDF")
    assert (folder / "table.md").read_text() == markdown(bundled_analysis.table())
    unfiltered = bundled_analysis.table(unfiltered=True)
    assert (folder / "table_unfiltered.md").read_text() == markdown(unfiltered)
    rows = list(csv.reader((folder / "table.csv").read_text().splitlines()))
    assert float(rows[1][2]) == bundled_analysis.errors["riemannian"].joint
    loaded = go.synergies.load_synergies(folder / "synergies.json", bundled_analysis.metric)
    t = bundled_analysis.motion.time
    for synergy in loaded:
        here = slice(synergy.start, synergy.stop)
        assert np.array_equal(synergy(t[here]), bundled_analysis.predicted.q[here])


@pytest.mark.slow
def test_a_failed_save_leaves_nothing_half_written(
    bundled_analysis: go.synergies.Analysis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
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
    motion = motion_in(bundled_file, arm.joint_names)
    go.analyse(arm, motion.part(740, len(motion) - 1), progress=lambda *report: seen.append(report))
    assert seen[0][0] == "cutting into segments"
    assert seen[-1][1] == seen[-1][2] > 0
    assert [done for _, done, _ in seen] == sorted(done for _, done, _ in seen)


def test_repr_is_short_and_notebooks_show_the_table(
    bundled_analysis: go.synergies.Analysis,
) -> None:
    lines = repr(bundled_analysis).splitlines()
    assert len(lines) == 3
    assert f"{len(bundled_analysis.synergies)} geodesic synergies" in lines[0]
    assert "kinetic energy with joint inertia 0.0" in lines[1]
    assert repr(bundled_analysis.errors["riemannian"]) in lines[2]
    assert bundled_analysis._repr_markdown_() == markdown(bundled_analysis.table())


def test_mistakes_are_named(bundled_file: Path, bundled_analysis: go.synergies.Analysis) -> None:
    motion = motion_in(bundled_file)
    with pytest.raises(ValueError, match="there is no joint RSx_joint"):
        go.analyse(go.human_arm("right"), motion)
    with pytest.raises(ValueError, match="too short to filter"):
        go.analyse(bundled_analysis.model, motion.part(0, 9))
    degrees = dataclasses.replace(motion, q=np.degrees(motion.q))
    with pytest.raises(ValueError, match="are these degrees"):
        go.analyse(bundled_analysis.model, degrees)
    jump = motion.q.copy()
    jump[200:, 4] -= 2.5
    with pytest.raises(ValueError, match=r"LEz_joint (is|jumps from)"):
        go.analyse(bundled_analysis.model, dataclasses.replace(motion, q=jump))
    still = dataclasses.replace(motion, q=np.tile(motion.q[0], (len(motion), 1)))
    with pytest.raises(ValueError, match="never moves"):
        go.analyse(bundled_analysis.model, still)


# Cuts where the angle exceeds 0.6 rad at a sample, without interpolation between samples.
SAMPLED_RULE = [0, 8, 11, 15, 27, 84, 123, 131, 133, 135, 140, 159, 202, 234, 287, 290, 292, 295]
SAMPLED_RULE += [302, 311, 337]


@pytest.mark.slow
def test_take_book_from_shelf(shared: Path) -> None:
    """Values of an independent implementation of the paper's metric and rule, to 20 %."""
    file = shared / "data" / "kit" / "take_book_from_shelf_right_arm_02.xml"
    arm = go.human_arm("right", 1.83, 100.0)
    motion = motion_in(file).filtered(window=21, order=2)
    rule = partial(go.segment, min_duration=0.0, hysteresis=0.0)
    analysis = go.analyse(arm, motion, metric="kinetic", segments=rule)
    assert len(analysis.segments) == pytest.approx(20, rel=0.2)
    sampled = list(itertools.pairwise(SAMPLED_RULE))
    errors = go.analyse(arm, motion, metric="kinetic", segments=sampled).errors
    assert errors["riemannian"].joint == pytest.approx(0.057, rel=0.2)
    assert errors["riemannian"].position == pytest.approx(0.013, rel=0.2)
    assert errors["euclidean_same_segments"].joint == pytest.approx(0.033, rel=0.2)
    assert errors["euclidean_same_segments"].position == pytest.approx(0.029, rel=0.2)


@pytest.mark.slow
def test_joint_inertia_explains_a_recording_better_than_straight_lines(shared: Path) -> None:
    """On the same segments, in the joints and in position and orientation of the hand."""
    file = shared / "data" / "kit" / "take_book_from_shelf_right_arm_02.xml"
    arm = go.human_arm("right", 1.83, 100.0)
    errors = go.analyse(arm, motion_in(file)).errors
    ours, straight = errors["riemannian"], errors["euclidean_same_segments"]
    assert ours.joint < 0.95 * straight.joint
    assert ours.position < 0.8 * straight.position
    assert ours.orientation < 0.95 * straight.orientation


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "side"),
    [
        ("take_book_from_shelf_right_arm_03", "right"),
        ("Trial_75", "left"),
    ],
)
def test_every_log_map_of_every_recording_converges(name: str, side: str, shared: Path) -> None:
    arm = go.human_arm(side, 1.83, 100.0)
    metric = go.KineticEnergy(arm)
    motion = motion_in(shared / "data" / "kit" / f"{name}.xml")
    analysis = go.analyse(arm, motion, metric=metric)
    for synergy in analysis.synergies:
        start, stop = synergy.path(0.0), synergy.path(1.0)
        arrival = go.exp(metric, start, go.log(metric, start, stop), tolerance=1e-12)
        assert np.abs(arrival - stop).max() <= 1e-9


@pytest.fixture(scope="module")
def planar() -> tuple[go.Model, go.Motion]:
    """A reach of a planar arm with two joints that is no geodesic, and no straight line."""
    arm = planar_arm((0.3, 0.3), (2.0, 1.2), (0.15, 0.13), (0.015, 0.009))
    time = np.linspace(0.0, 1.2, 121)  # [s]
    s = time / time[-1]
    progress = 10 * s**3 - 15 * s**4 + 6 * s**5
    q = np.column_stack([0.2 + 1.5 * progress, 1.5 - 0.8 * progress + 0.9 * np.sin(np.pi * s) ** 2])
    return arm, go.Motion(time, q, arm.joint_names)


@pytest.mark.slow
def test_the_default_metric_has_joint_inertia(planar: tuple[go.Model, go.Motion]) -> None:
    """The model's own, if it has any; otherwise 0.03 m r^2."""
    arm, motion = planar
    default, own = go.analyse(arm, motion), go.analyse(arm.with_armature([0.0, 0.2]), motion)
    assert isinstance(default.metric, go.KineticEnergy)
    assert np.array_equal(default.metric.model.armature, go.manifold.default_joint_inertia(arm))
    assert own.metric == go.KineticEnergy(own.model)
    named = go.analyse(arm, motion, metric="joint-inertia")
    assert np.array_equal(named.metric.model.armature, default.metric.model.armature)
    assert default.model is arm
    for analysis in (default, own):
        assert set(analysis.errors) == set(METHODS)
    given = go.KineticEnergy(arm.with_armature([0.0, 0.2]))
    assert go.analyse(arm, motion, metric=given).segments == own.segments


@pytest.mark.slow
def test_kinetic_is_without_joint_inertia_also_for_a_model_with_some(
    planar: tuple[go.Model, go.Motion],
) -> None:
    arm, motion = planar
    geared = arm.with_armature(0.2)
    of_links, of_geared = (go.analyse(each, motion, metric="kinetic") for each in (arm, geared))
    assert of_geared.metric_name == of_links.metric_name == "kinetic energy"
    assert of_geared.segments == of_links.segments
    beside = go.analyse(geared, motion, segments=of_links.segments)
    for first, second in (
        (of_geared.errors["riemannian"], of_links.errors["riemannian"]),
        (beside.errors["kinetic_energy"], of_links.errors["riemannian"]),
        (of_geared.errors["joint_inertia"], beside.errors["riemannian"]),
    ):
        assert first.joint == pytest.approx(second.joint, rel=1e-6)
        assert first.position == pytest.approx(second.position, rel=1e-6)


def test_geodesics_do_not_depend_on_the_unit_of_mass(planar: tuple[go.Model, go.Motion]) -> None:
    """The body mass of a recording, often a placeholder, must not decide the result."""
    light, heavy = (go.human_arm("right", 1.8, mass) for mass in (50.0, 100.0))
    ratio = go.manifold.default_joint_inertia(heavy) / go.manifold.default_joint_inertia(light)
    assert ratio == pytest.approx(2.0)
    tall = go.human_arm("right", 1.98, 50.0)
    ratio = go.manifold.default_joint_inertia(tall) / go.manifold.default_joint_inertia(light)
    assert ratio == pytest.approx(1.1**2, rel=2e-3)  # the reach is found numerically


@pytest.mark.slow
def test_each_metric_is_compared_with_the_others(planar: tuple[go.Model, go.Motion]) -> None:
    arm, motion = planar
    kinetic, flat = (go.analyse(arm, motion, metric=name) for name in ("kinetic", "euclidean"))
    same = {"riemannian", "euclidean_same_segments", "euclidean", "ik"}
    assert kinetic.metric == go.KineticEnergy(arm)
    assert set(kinetic.errors) == {*same, "joint_inertia"}
    assert set(flat.errors) == {*same, "joint_inertia", "kinetic_energy"}
    assert flat.errors["riemannian"] == flat.errors["euclidean_same_segments"]
    titles = [str(row[0]) for row in rows_of_table(flat.table())]
    assert titles[0] == "straight lines, same segments"
    assert len(set(titles)) == len(titles)
    # On the segments of one analysis, the comparison is the reconstruction in the other metric.
    motion = kinetic.motion
    for analysis, method, metric in (
        (flat, "kinetic_energy", go.KineticEnergy(arm)),
        (kinetic, "joint_inertia", go.analyse(arm, motion).metric),
    ):
        again = go.synergies.reconstruct(metric, analysis.motion, analysis.segments)
        expected = go.synergies.motion_errors(arm, analysis.motion, again.predicted)
        assert analysis.errors[method].joint == pytest.approx(expected.joint, rel=1e-6)


def test_a_metric_of_ones_own(planar: tuple[go.Model, go.Motion]) -> None:
    arm, motion = planar

    class Doubled(go.KineticEnergy):
        """Twice the kinetic energy, with the same geodesics."""

        def matrix(self, q: Any) -> Any:
            return 2.0 * self.model.mass_matrix(q)

    own, kinetic = (
        go.analyse(arm, motion, metric=Doubled(arm)),
        go.analyse(arm, motion, metric="kinetic"),
    )
    assert own.segments == kinetic.segments
    assert own.errors["riemannian"].joint == pytest.approx(kinetic.errors["riemannian"].joint)
    assert set(own.errors) == {*METHODS, "joint_inertia"}
    assert rows_of_table(own.table())[0][0] == "geodesics, Doubled"


def test_segments_can_be_given(planar: tuple[go.Model, go.Motion]) -> None:
    arm, motion = planar
    analysis = go.analyse(arm, motion, segments=[(0, 50), (50, 120)])
    assert analysis.segments == ((0, 50), (50, 120))
    assert analysis.cuts == "given"
    assert [(each.start, each.stop) for each in analysis.synergies] == [(0, 50), (50, 120)]
    with pytest.raises(ValueError, match="segments must cover samples 0 to 120"):
        go.analyse(arm, motion, segments=[(0, 50), (60, 120)])


@pytest.mark.slow
def test_a_motion_is_cut_by_a_function_that_is_named(planar: tuple[go.Model, go.Motion]) -> None:
    arm, motion = planar
    motion = motion.filtered()
    metric = go.KineticEnergy(arm)
    developed = go.synergies.segment_developed
    assert go.analyse(arm, motion, metric=metric).cuts == "developed"
    for rule, name in (
        (developed, "developed"),
        (partial(developed, deviation=0.02, rest=0.02), "developed, deviation 0.02"),
        (go.segment, "online"),
        (partial(go.segment, rest=0.4, threshold=0.2), "online, rest 0.4, threshold 0.2"),
        (lambda metric, motion: [(0, len(motion) - 1)], "<lambda>"),
    ):
        analysis = go.analyse(arm, motion, metric=metric, segments=rule)
        assert list(analysis.segments) == rule(metric, motion)
        assert analysis.cuts == name
        assert f"synergies, {name}," in repr(analysis)


def test_errors_against_the_recording_as_it_is(planar: tuple[go.Model, go.Motion]) -> None:
    """What a filter takes away is an error, too."""
    arm, smooth = planar
    noise = 0.01 * np.random.default_rng(0).normal(size=smooth.q.shape)  # [rad]
    noisy = dataclasses.replace(smooth, q=smooth.q + noise)
    analysis = go.analyse(arm, noisy)
    assert set(analysis.errors_unfiltered) == set(analysis.errors)
    for method, prediction in analysis.predictions.items():
        against = go.synergies.motion_errors(arm, noisy, prediction)
        assert analysis.errors_unfiltered[method] == against
    # The mean of |x| of the noise is sqrt(2 / pi) of its standard deviation.
    assert analysis.errors_unfiltered["riemannian"].joint > 0.7 * 0.01 * np.sqrt(2.0 / np.pi)
    table = analysis.table(unfiltered=True)
    assert [row[0] for row in rows_of_table(table)] == [
        row[0] for row in rows_of_table(analysis.table())
    ]
    assert rows_of_table(table)[0][2] == analysis.errors_unfiltered["riemannian"].joint
    velocities = dataclasses.replace(smooth, velocity=smooth(smooth.time, 1))
    unknown = go.analyse(arm, velocities)
    assert unknown.errors_unfiltered == {}
    with pytest.raises(ValueError, match="the unfiltered motion is not known"):
        unknown.table(unfiltered=True)


def test_a_segment_without_a_geodesic_does_not_lose_the_others(
    planar: tuple[go.Model, go.Motion], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Errors of the metric that is compared are means over the samples of the other segments."""
    recording_rows = pytest.importorskip("geodesic_ocp.studies.study_tables").recording_rows
    arm, motion = planar
    cut = [(0, 50), (50, 90), (90, 120)]
    whole = go.analyse(arm, motion, segments=cut)
    motion = whole.motion

    def fail(metric: go.Metric, q0: np.ndarray, *ends: Any, **options: Any) -> Any:
        plain = isinstance(metric, go.KineticEnergy) and not metric.model.armature.any()
        if plain and any(np.array_equal(q0, motion.q[start]) for start in lacking):
            raise go.NotConverged("no geodesic")
        return go.geodesic(metric, q0, *ends, **options)

    monkeypatch.setattr(synergy_module, "geodesic", fail)
    lacking = [50]
    told = r"kinetic energy: .* for 1 of 3 segments, 0\.500 to 0\.900 s.*50 to 90.*over the others"
    with pytest.warns(RuntimeWarning, match=told):
        analysis = go.analyse(arm, motion, segments=cut)
    assert analysis.not_found == ("kinetic_energy",)
    assert analysis.without_geodesic == {"kinetic_energy": (1,)}
    assert analysis.segments_found("kinetic_energy") == 2
    known = np.r_[0:51, 90:121]
    differences = whole.predictions["kinetic_energy"].q[known] - motion.q[known]
    found = analysis.errors["kinetic_energy"]
    assert found.joint == pytest.approx(np.abs(differences).mean(), rel=1e-12)
    assert {**analysis.errors, "kinetic_energy": 0} == {**whole.errors, "kinetic_energy": 0}
    row = analysis.table().loc["geodesics, kinetic energy"]
    assert row["segments"] == "2 of 3"
    assert row["joints [rad]"] == found.joint
    note = "Not found: geodesics, kinetic energy from 0.50 to 0.90 s, where its errors do not count"
    assert note in text(analysis.table())
    (in_study,) = (r for r in recording_rows(analysis, False) if r["method"] == "kinetic_energy")
    assert (in_study["segments"], in_study["segments_found"]) == (3, 2)
    assert in_study["joint_error_rad"] == found.joint

    lacking = [0, 50, 90]
    with pytest.warns(RuntimeWarning, match="for 3 of 3 segments.* left out of the comparison"):
        analysis = go.analyse(arm, motion, segments=cut)
    assert set(analysis.errors) == {*METHODS} - {"kinetic_energy"}
    row = analysis.table().loc["geodesics, kinetic energy"]
    assert row["segments"] == "0 of 3"
    assert row.drop("segments").isna().all()
    with pytest.raises(go.NotConverged):  # of the analysis' own metric, it is an error
        go.analyse(arm, motion, segments=cut, metric="kinetic")


def test_wrong_metrics_are_named(planar: tuple[go.Model, go.Motion]) -> None:
    arm, motion = planar
    with pytest.raises(ValueError, match="metric must be 'joint-inertia', 'kinetic', 'euclidean'"):
        go.analyse(arm, motion, metric="mass")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="metric has dimension 7 of the joints RSx_joint"):
        go.analyse(arm, motion, metric=go.KineticEnergy(go.human_arm()))
    with pytest.raises(ValueError, match="metric has dimension 3, but 'planar arm with 2 links'"):
        go.analyse(arm, motion, metric=go.Euclidean(3))


def test_the_default_joint_inertia_needs_a_reach() -> None:
    """Of a hinge on a slide, which has its own only where the slide has limits."""
    native, free, ball = pin.Model(), np.array([np.inf]), pin.Inertia.FromSphere(2.0, 0.1)
    limits = free, free, -free, free
    at_origin, behind = pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.5]))
    slide = native.addJoint(0, pin.JointModelPX(), at_origin, "slide", *limits)
    native.appendBodyToJoint(slide, ball, at_origin)
    hinge = native.addJoint(slide, pin.JointModelRX(), at_origin, "hinge", *limits)
    native.appendBodyToJoint(hinge, ball, behind)
    native.addFrame(pin.Frame("tip", hinge, behind, pin.FrameType.OP_FRAME))
    model = go.Model(native, "tip")
    with pytest.raises(ValueError, match="has no default joint inertia: limit its joints"):
        go.manifold.default_joint_inertia(model)
    limited = model.with_limits({"slide": -1.2}, {"slide": 1.2})
    expected = [FRACTION * 4.0, FRACTION * 4.0 * 1.3**2]  # [kg], [kg m^2]: reach hypot(1.2, 0.5)
    assert go.manifold.default_joint_inertia(limited) == pytest.approx(expected, rel=1e-3)
