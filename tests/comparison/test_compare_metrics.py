"""Error against number of synergies, and how many are worth having."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from smooth_motions import reversing
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.drawing.comparison_figure import draw_curves
from geodesic_ocp.studies.compare_metrics import bayesian_information, noise_left
from geodesic_ocp.trajectory.motion import bandwidth

OPTIONS = {"spacing": 0.1, "rules": {"online": go.segment}}


@pytest.fixture(scope="module")
def motion() -> go.Motion:
    return reversing()


@pytest.fixture(scope="module")
def metrics(arm_metric: go.KineticEnergy) -> dict[str, go.Metric]:
    return {"G": arm_metric, "lines": go.Euclidean(7)}


@pytest.fixture(scope="module")
def comparison(
    arm: go.Model, motion: go.Motion, metrics: dict[str, go.Metric]
) -> go.studies.MetricComparison:
    return go.studies.compare_metrics(arm, motion, metrics, measure="position", **OPTIONS)


@pytest.mark.slow
def test_every_metric_has_its_own_optimal_cuts_and_their_errors_in_all_measures(
    comparison: go.studies.MetricComparison,
    arm: go.Model,
    motion: go.Motion,
    metrics: dict[str, go.Metric],
) -> None:
    for name, metric in metrics.items():
        found = go.synergies.optimal_segmentations(
            metric, motion, measure="position", model=arm, spacing=0.1
        )
        curve = comparison.curves[name]
        assert curve.index.tolist() == found.counts.tolist() == list(range(1, 10))
        assert curve["position"].tolist() == pytest.approx(found.errors, rel=1e-6)
        assert list(curve["cuts"][5]) == found.segments(5, refined=False)
        predicted = go.synergies.reconstruct(metric, motion, curve["cuts"][5]).predicted
        errors = go.synergies.motion_errors(arm, motion, predicted)
        assert curve["joint"][5] == pytest.approx(errors.joint, rel=1e-6)
        assert curve["orientation"][5] == pytest.approx(errors.orientation, rel=1e-6)


@pytest.mark.slow
def test_the_online_rule_is_a_point_with_its_own_cuts(
    comparison: go.studies.MetricComparison,
    arm: go.Model,
    motion: go.Motion,
    metrics: dict[str, go.Metric],
) -> None:
    for name, metric in metrics.items():
        segments = go.segment(metric, motion, 0.6)
        errors = go.synergies.motion_errors(
            arm, motion, go.synergies.reconstruct(metric, motion, segments).predicted
        )
        ((rule, *found),) = comparison.by_rule[name].itertuples()
        expected = [len(segments), errors.joint, errors.position, errors.orientation]
        assert (rule, found) == ("online", expected)


@pytest.mark.slow
def test_chosen_counts_can_be_refined(
    comparison: go.studies.MetricComparison, arm: go.Model, motion: go.Motion
) -> None:
    lines = {"lines": go.Euclidean(7)}
    options = {**OPTIONS, "measure": "position", "counts": [4, 3], "refined": True}
    refined = go.studies.compare_metrics(arm, motion, lines, **options).curves["lines"]
    assert refined.index.tolist() == [3, 4]
    assert np.all(refined["position"] <= comparison.curves["lines"]["position"][[3, 4]])
    with pytest.raises(ValueError, match="count must be 1 to 9"):
        go.studies.compare_metrics(arm, motion, lines, **{**options, "counts": [10]})


@pytest.mark.slow
def test_the_number_worth_having_is_that_of_a_motion_made_of_so_many(arm: go.Model) -> None:
    """Straight lines at one speed with noise: more segments only fit the noise."""
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(4, 7))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    time = np.linspace(0.0, 1.6, 161)
    piece = np.minimum(np.arange(161) // 40, 3)
    steps = 0.01 * directions[piece[:-1]]
    q = np.vstack([np.zeros(7), np.cumsum(steps, axis=0)])
    for noise in (1e-3, 4e-3):
        seen = q + noise * rng.normal(size=q.shape)
        seen[::40] = q[::40]  # the ends of the segments are fitted to one sample each
        motion = go.Motion(time, seen, arm.joint_names, directions[piece])
        comparison = go.studies.compare_metrics(
            arm,
            motion,
            {"lines": go.Euclidean(7)},
            spacing=0.1,
            rules={},
            noise=noise,
            cutoff=50.0,
        )
        assert comparison.best_count("lines") == 4
    # Noise as large as the motion leaves nothing to explain.
    nothing = go.studies.compare_metrics(
        arm, motion, {"lines": go.Euclidean(7)}, spacing=0.1, rules={}, noise=1.0
    )
    assert nothing.best_count("lines") == 1


def test_criterion_is_the_likelihood_and_the_cost_of_the_parameters() -> None:
    rng = np.random.default_rng(2)
    residuals = 0.02 * rng.normal(size=(100, 3))
    noise = np.array([0.01, 0.01, 1.0])  # the last joint's residuals are below its noise
    squares = np.mean(residuals**2, axis=0)
    misfit = np.log(squares[0]) + np.log(squares[1]) + 2.0 + 0.0 + squares[2]
    value = bayesian_information(residuals, 4, noise, 50.0)
    assert value == pytest.approx(50.0 * misfit + 4 * 5 * np.log(150.0))
    more = bayesian_information(residuals, 5, noise, 50.0)
    assert more - value == pytest.approx(5 * np.log(150.0))


def test_noise_and_bandwidth_come_from_the_filter_or_as_given(arm: go.Model) -> None:
    rng = np.random.default_rng(3)
    time = np.arange(600) / 100.0
    clean = 0.3 * np.sin(2.0 * time)[:, None] * np.ones(7)
    raw = go.Motion(time, clean + 5e-3 * rng.normal(size=clean.shape), arm.joint_names)
    # Without a filter: second differences see the noise, whatever the motion.
    assert noise_left(raw, None, 50.0) == pytest.approx(np.full(7, 5e-3), rel=0.2)
    filtered = raw.filtered(cutoff=5.0)
    assert bandwidth(filtered, None) == 5.0
    left = noise_left(filtered, None, 5.0)
    middle = slice(50, -50)
    truth = np.sqrt(np.mean((filtered.q - clean)[middle] ** 2, axis=0))
    assert np.mean(left) == pytest.approx(np.mean(truth), rel=0.25)
    assert bandwidth(raw.filtered(duration=0.21), None) == pytest.approx(5.4, abs=0.3)
    # Without a filter every sample counts, as its noise is independent of the others'.
    assert bandwidth(raw) == pytest.approx(50.0, rel=0.01)
    assert bandwidth(raw, 6.0) == 6.0
    assert bandwidth(raw, 80.0) == pytest.approx(50.0, rel=0.01)
    assert noise_left(raw, 0.01, 5.0).tolist() == [0.01] * 7
    for wrong in (0.0, [0.01, 0.02], np.nan):
        with pytest.raises(ValueError, match="noise must be one or 7 positive numbers"):
            noise_left(raw, wrong, 5.0)


@pytest.mark.slow
def test_without_metrics_three_are_compared(arm: go.Model, motion: go.Motion) -> None:
    seen: list[str] = []
    result = go.studies.compare_metrics(
        arm, motion, **OPTIONS, progress=lambda label, done, total: seen.append(label)
    )
    names = ["kinetic energy with joint inertia", "kinetic energy", "straight lines"]
    assert list(result.curves) == list(result.by_rule) == names
    assert list(dict.fromkeys(seen)) == [f"{name}: planning segments" for name in names]
    stiff = go.KineticEnergy(arm.with_armature(go.manifold.default_joint_inertia(arm)))
    by_hand = go.synergies.optimal_segmentations(stiff, motion, spacing=0.1)
    assert result.curves[names[0]]["joint"].tolist() == pytest.approx(by_hand.errors, rel=1e-6)


@pytest.mark.slow
def test_table_figure_and_files(comparison: go.studies.MetricComparison, tmp_path: Path) -> None:
    assert repr(comparison).startswith("MetricComparison(human right arm, 0.9 s, cuts of least pos")
    table = comparison.table([2, 5])
    assert [row[:3] for row in rows_of_table(table) if row[0] == "lines"][:2] == [
        ("lines", "optimal", 2),
        ("lines", "optimal", 5),
    ]
    assert rows_of_table(table)[0][4] == comparison.curves["G"]["position"][2]
    with pytest.raises(ValueError, match=r"counts \[11\] are not among those compared"):
        comparison.table([11])
    best = [row for row in rows_of_table(comparison.table()) if "BIC" in str(row[1])]
    assert [row[2] for row in best] == [comparison.best_count(name) for name in ("G", "lines")]
    with pytest.raises(ValueError, match="name must be one of G, lines, got 'log'"):
        comparison.best_count("log")

    axes = Figure().subplots()
    draw_curves(axes, comparison)
    assert axes.get_xlabel() == "number of segments"
    assert axes.get_ylabel() == "mean error of the hand's position [m]"
    assert axes.get_xlim()[1] == 10.0
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["G", "lines", "least BIC", "online cuts"]
    curve = axes.get_lines()[0]
    assert curve.get_ydata() == pytest.approx(comparison.curves["G"]["position"].to_numpy())
    with pytest.raises(ValueError, match="measure must be one of joint, position, orientation"):
        draw_curves(axes, comparison, "hand")

    files = comparison.save(tmp_path / "new")
    assert {file.name for file in files} == {"table.csv", "table.md", "figure.png", "figure.pdf"}
    assert (tmp_path / "new" / "table.csv").read_text().count("\n") == 1 + 2 * (9 + 1)


def test_metrics_that_do_not_fit_are_refused(arm: go.Model, motion: go.Motion) -> None:
    with pytest.raises(ValueError, match="metrics must be at least one, got none"):
        go.studies.compare_metrics(arm, motion, {})
    with pytest.raises(ValueError, match=r"metrics must have names, .* got \[Euclidean"):
        go.studies.compare_metrics(arm, motion, [go.Euclidean(7)])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="'kinetic' must be a metric, or a function of a model"):
        go.studies.compare_metrics(arm, motion, {"kinetic": "kinetic"})  # type: ignore[dict-item]
    with pytest.raises(ValueError, match="metrics: 'arm': metric must be an instance of a Metric"):
        go.studies.compare_metrics(arm, motion, {"arm": lambda model: model})
    with pytest.raises(ValueError, match="metrics: 'small': metric has dimension 3"):
        go.studies.compare_metrics(arm, motion, {"small": go.Euclidean(3)})
    for counts in ([], 3):
        with pytest.raises(ValueError, match="counts must be one or more numbers of segments"):
            go.studies.compare_metrics(arm, motion, {"lines": go.Euclidean(7)}, counts=counts)


def test_functions_of_the_model_are_metrics(
    comparison: go.studies.MetricComparison, arm: go.Model, motion: go.Motion
) -> None:
    given = {"lines": lambda model: go.Euclidean(model.dof)}
    found = go.studies.compare_metrics(arm, motion, given, measure="position", **OPTIONS)
    assert found.curves["lines"]["joint"].equals(comparison.curves["lines"]["joint"])


@pytest.mark.slow
def test_joint_inertia_explains_a_recording_better_than_straight_lines(shared: Path) -> None:
    """At equal numbers of segments, in joints and hand, each metric with its own best cuts.

    The kinetic energy of the links alone does not, in the joints.
    """
    arm = go.human_arm("right", height=1.83)
    file = shared / "data" / "kit" / "hand_to_mouth_right_arm_01.xml"
    motion = go.read_motion(file).select(arm.joint_names)
    metrics = {
        "inertia": go.KineticEnergy(arm.with_armature(0.05)),
        "links": go.KineticEnergy(arm),
        "lines": go.Euclidean(7),
    }
    counts = [4, 8, 12, 16, 20, 24]
    comparison = go.studies.compare_metrics(
        arm, motion, metrics, counts=counts, spacing=0.1, rules={}
    )
    inertia, links, lines = comparison.curves.values()
    assert np.all(inertia["joint"] < lines["joint"])
    assert np.all(inertia["position"] < lines["position"])
    assert np.all(links["joint"] > lines["joint"])
