"""Markers that are in other units or axes, or that no person has, are not fitted in silence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from marked_motion import HEIGHT, MMM_MARKERS, angles, marked
from small_recordings import MARKER_TABLE, TRC

import geodesic_ocp as go
from geodesic_ocp.recordings.markers.fit_markers import fit_markers
from geodesic_ocp.recordings.markers.fit_program import kept_weights
from geodesic_ocp.recordings.markers.markers import (
    Axis,
    Markers,
    check_plausible_size,
    frozen_samples,
    with_z_up,
)
from geodesic_ocp.recordings.read_recording import read_markers, read_recording
from geodesic_ocp.tables import text

AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
AXES |= {"-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}


@pytest.fixture(scope="module")
def walker() -> Markers:
    """Markers of a person who walks upright, with both shoulders and the right arm."""
    arm, time = go.human_arm("right", HEIGHT), np.arange(30) / 30.0
    return marked(arm, angles(arm, time), time, MMM_MARKERS)


@pytest.mark.parametrize("up", AXES)
def test_the_axis_that_is_up_becomes_z_by_a_rotation(up: Axis) -> None:
    points = np.stack([np.eye(3), np.random.default_rng(0).normal(size=(3, 3))])
    markers = Markers(np.arange(2.0), ("a", "b", "c"), points)
    turned = with_z_up(markers, up).positions
    turn = turned[0].T
    np.testing.assert_allclose(turn @ AXES[up], (0, 0, 1), atol=0)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    np.testing.assert_allclose(turned[1], points[1] @ turn.T)


@pytest.mark.parametrize("up", ["x", "y", "-x", "-y", "-z"])
def test_a_person_who_is_not_upright_is_asked_about(up: Axis, walker: Markers) -> None:
    """The message names the axis with which the fit is that of the upright person."""
    to_z = with_z_up(Markers(np.arange(2.0), ("a", "b", "c"), np.stack([np.eye(3)] * 2)), up)
    other = replace(walker, positions=walker.positions @ to_z.positions[0].T)
    arm = go.human_arm("right", HEIGHT)
    with pytest.raises(ValueError, match=f"is {up} up[?] Then pass up='{up}'"):
        fit_markers(arm, other)
    np.testing.assert_allclose(with_z_up(other, up).positions, walker.positions, atol=1e-12)


@pytest.mark.slow
def test_a_person_may_lie_if_that_is_said(walker: Markers) -> None:
    arm = go.human_arm("right", HEIGHT)
    upright = fit_markers(arm, walker, estimate=())
    lying = replace(
        walker, positions=walker.positions @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    )
    with pytest.raises(ValueError, match="pass up='z' if z is up and the person lies"):
        fit_markers(arm, lying, estimate=())
    fit = fit_markers(arm, lying, estimate=(), up="z")
    np.testing.assert_allclose(fit.motion.q, upright.motion.q, atol=2e-3)
    assert fit.motion.trunk is not None
    assert np.abs(fit.motion.trunk.rotations[:, 2, 2]).max() < 0.5


@pytest.mark.slow
def test_a_stray_marker_of_the_thorax_does_not_lay_a_person_down(walker: Markers) -> None:
    positions = walker.positions.copy()
    positions[:, walker.names.index("C7")] += [0.0, 1.5, -1.0]
    arm = go.human_arm("right", HEIGHT)
    with pytest.warns(RuntimeWarning, match="C7 is 18.. mm from its place for 100% of the time"):
        fit = fit_markers(arm, replace(walker, positions=positions), estimate=())
    assert {each.marker for each in fit.lost} == {"C7"}
    assert fit.typical_error < 0.001


def test_the_axis_is_turned_when_a_file_is_read(tmp_path: Path) -> None:
    file = tmp_path / "walk.trc"
    file.write_text(TRC)
    expected = with_z_up(read_markers(file), "y").positions
    np.testing.assert_array_equal(read_markers(file, up="y").positions, expected)
    with pytest.raises(ValueError, match="up must be one of x, y, z, -x, -y, -z, got 'Y'"):
        read_markers(file, up="Y")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="up must be one of x, y, z, -x, -y, -z, got 'Y'"):
        read_recording(file, up="Y")  # type: ignore[arg-type]


def test_mirrored_people_are_refused(walker: Markers) -> None:
    arm = go.human_arm("right", HEIGHT)
    left_handed = replace(walker, positions=walker.positions * np.array([-1.0, 1.0, 1.0]))
    with pytest.raises(ValueError, match="right and left may be exchanged"):
        fit_markers(arm, left_handed)
    other = {"R": "L", "L": "R"}
    names = tuple(other.get(name[0], name[0]) + name[1:] for name in walker.names)
    with pytest.raises(ValueError, match="right and left may be exchanged"):
        fit_markers(go.human_arm("left", HEIGHT), replace(walker, names=names))


@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (1e3, "are the numbers mm or cm"),
        (1e2, "are the numbers mm or cm"),
        (1e1, r"the markers of the thorax are \S+ to \S+ times as far apart .* numbers mm or cm"),
        (1e-1, r"the markers of the thorax are \S+ to \S+ times as far apart .* numbers m or cm"),
        (1e-3, "m or cm"),
    ],
)
def test_positions_in_another_unit(factor: float, message: str, walker: Markers) -> None:
    scaled = replace(walker, positions=factor * walker.positions)
    with pytest.raises(ValueError, match=message):
        fit_markers(go.human_arm("right"), scaled)


def test_times_in_milliseconds_are_asked_about(walker: Markers) -> None:
    with pytest.raises(ValueError, match=r"samples are .* s apart: is time in milliseconds"):
        fit_markers(go.human_arm("right"), replace(walker, time=1e3 * walker.time))


def test_markers_of_the_other_arm_are_named(walker: Markers) -> None:
    trunk = {name for name, (segment, _) in MMM_MARKERS.places.items() if segment == "thorax"}
    names = tuple(each if each in trunk else f"L{each[1:]}" for each in walker.names)
    with pytest.raises(ValueError, match=r"determine none of .*; not on it, .*, are L"):
        fit_markers(go.human_arm("right"), replace(walker, names=names), up="z")


def test_a_misspelt_segment_of_a_set_is_told(walker: Markers) -> None:
    places = dict(MMM_MARKERS.places)
    places["RWTS"] = ("right forarm", places["RWTS"][1])
    misspelt = replace(MMM_MARKERS, places=places)
    arm = go.human_arm("right", HEIGHT)
    with pytest.warns(RuntimeWarning, match="has RWTS on 'right forarm', which is neither a seg"):
        fit = fit_markers(arm, walker, marker_set=misspelt, estimate=())
    assert fit.left_out == ("RWTS",)


@pytest.mark.parametrize("content", [TRC, MARKER_TABLE])
def test_files_whose_unit_is_wrong_are_refused(content: str, tmp_path: Path) -> None:
    file = tmp_path / "walk.dat"
    file.write_text(content.replace("mm", "m"))
    with pytest.raises(go.RecordingError, match=r"walk\.dat: half of the markers are") as found:
        read_markers(file)
    assert "are the numbers mm or cm?" in str(found.value)


def test_single_markers_that_are_far_away_do_not_count(walker: Markers) -> None:
    positions = walker.positions.copy()
    positions[:, 0] = 1e4
    check_plausible_size(replace(walker, positions=positions))
    check_plausible_size(replace(walker, positions=np.full_like(positions, np.nan)))


@pytest.mark.slow
def test_positions_in_a_room_have_no_fixed_base(walker: Markers) -> None:
    with pytest.raises(
        ValueError, match=r"not fitted: markers are typically .* Check base='fixed'"
    ):
        fit_markers(go.human_arm("right", HEIGHT), walker, base="fixed", estimate=())


@pytest.mark.slow
def test_names_that_are_permuted_are_no_fit(walker: Markers) -> None:
    arm_names = [name for name in walker.names if MMM_MARKERS.places[name][0] != "thorax"]
    mixed = dict(zip(arm_names, np.random.default_rng(1).permutation(arm_names), strict=True))
    names = tuple(str(mixed.get(name, name)) for name in walker.names)
    with pytest.raises(ValueError, match="names that mean other places"):
        fit_markers(go.human_arm("right", HEIGHT), replace(walker, names=names))


@pytest.mark.slow
def test_a_height_that_no_adult_has_is_not_believed(walker: Markers) -> None:
    """Unless it is given: then the model is of this height."""
    tall = replace(walker, positions=1.5 * walker.positions)
    with pytest.raises(ValueError, match=r"the body height would be 2\.\d+ m"):
        fit_markers(go.human_arm("right", HEIGHT), tall)
    fit = fit_markers(go.human_arm("right", HEIGHT), tall, height=1.5 * HEIGHT)
    assert fit.height == pytest.approx(1.5 * HEIGHT)


@pytest.mark.slow
def test_markers_that_the_fit_rejects_determine_nothing(walker: Markers) -> None:
    """As if they were missing, when other points carry the names of the hand's markers."""
    columns = [walker.names.index(name) for name in ("RHTS", "RHPS", "RIFD")]
    elsewhere, missing = walker.positions.copy(), walker.positions.copy()
    elsewhere[:, columns] = walker.positions[:, [0, 1, 2]] - [0.0, 0.0, 1.0]
    missing[:, columns] = np.nan
    arm, fits = go.human_arm("right", HEIGHT), []
    for positions in (elsewhere, missing):
        with pytest.warns(RuntimeWarning, match="do not determine RWx_joint, RWy_joint"):
            fits.append(fit_markers(arm, replace(walker, positions=positions), estimate=()))
    assert fits[0].undetermined == fits[1].undetermined
    assert {each.marker for each in fits[0].lost} == {"RHTS", "RHPS", "RIFD"}
    assert sum("for 100% of the time" in each for each in fits[0].doubts) == 3
    assert fits[0].motion.doubts == fits[0].doubts
    np.testing.assert_allclose(fits[0].motion.q[:, :5], fits[1].motion.q[:, :5], atol=1e-3)


@pytest.mark.slow
def test_the_markers_of_another_person_are_not_fitted(walker: Markers) -> None:
    """Not even if they are the only ones of the hand."""
    names = [f"Bob:{n}" if n in ("RHTS", "RHPS", "RIFD") else f"Ann:{n}" for n in walker.names]
    both = replace(walker, names=tuple(names))
    with pytest.warns(RuntimeWarning, match=r"Ann is taken, not Bob|RWx_joint, RWy_joint") as told:
        fit = fit_markers(go.human_arm("right", HEIGHT), both, estimate=())
    assert len(told) == 2
    assert len(fit.names) == len(names) - 3
    assert fit.motion.subject.name == "Ann"


@pytest.mark.slow
def test_doubts_of_size_and_distance(walker: Markers) -> None:
    """A height that no adult has, if it is estimated, and markers that are far away on average."""
    tall = replace(walker, positions=2.1 / HEIGHT * walker.positions)
    with pytest.warns(RuntimeWarning, match=r"the body height would be 2\.1\d m, from lengths"):
        fit = fit_markers(go.human_arm("right", HEIGHT), tall)
    assert fit.height == pytest.approx(2.1, rel=0.03)
    given = replace(fit, height_estimated=False)
    assert given.doubts == ()
    errors = np.full(fit.errors.shape, 0.001)
    errors[:12, [0, 1, -2, -1]] = 1.0
    apart = replace(given, errors=errors, weights=kept_weights(errors, 0.03))
    assert apart.doubts == ("markers are 95 mm from their places on average",)


def test_a_position_that_is_held_is_no_measurement() -> None:
    """A forearm of closed form turns; one of its markers is held for 70 % of the time."""
    time = np.arange(101) / 50.0
    axes = np.stack([np.cos(time), np.sin(time), 0.0 * time], axis=1)
    elbow = np.zeros((time.size, 3))
    points = np.stack([elbow, 0.2 * axes, 0.25 * axes], axis=1)
    assert not frozen_samples(points, [0, 3, 3], 0.03).any()
    points[30:, 2] = points[30, 2]
    held = frozen_samples(points, [0, 3, 3], 0.03)
    assert held[:, 2].mean() == pytest.approx(71 / 101)
    assert not held[:, :2].any()
    # Without another marker on the segment, the nearest one moves away from the one that is held.
    assert np.array_equal(frozen_samples(points, [0, 3, 5], 0.03), held)
    assert not frozen_samples(np.repeat(points[30:31], time.size, axis=0), [0, 3, 3], 0.03).any()


@pytest.mark.slow
def test_doubts_are_told_once(walker: Markers, tmp_path: Path) -> None:
    rows = walker.positions.copy()
    rows[:, [walker.names.index(name) for name in ("RHTS", "RHPS", "RIFD")]] = np.nan
    arm = go.human_arm("right", HEIGHT)
    with pytest.warns(RuntimeWarning, match="do not determine RWx_joint, RWy_joint") as told:
        fit = fit_markers(arm, replace(walker, positions=rows), height=HEIGHT)
    assert len(told) == 1
    assert fit.doubts == ("the markers do not determine RWx_joint, RWy_joint",)
    assert np.flatnonzero(np.isnan(fit.constant_errors)).tolist() == [5, 6]
    assert "RWx" not in text(fit.table()).partition("Constant errors")[2]
    assert 0.0 < fit.typical_error < 0.001
    header = ",".join(f"{name}_{axis}" for name in walker.names for axis in "xyz")
    lines = [
        ",".join([str(time), *("" if np.isnan(each) else f"{each:.6f}" for each in row.ravel())])
        for time, row in zip(walker.time, rows, strict=True)
    ]
    file = tmp_path / "walk.csv"
    file.write_text("\n".join(["# unit: m", f"time,{header}", *lines]))
    with pytest.warns(RuntimeWarning, match=r"walk\.csv: the markers do not determine") as told:
        read_recording(file, height=HEIGHT, unfiltered=True)
    assert len(told) == 1


def test_arrays_are_not_markers(walker: Markers) -> None:
    with pytest.raises(
        TypeError, match=r"must be Markers, got ndarray; give go\.recordings\.Markers"
    ):
        fit_markers(go.human_arm("right"), walker.positions)  # type: ignore[arg-type]


def test_gaps_that_leave_nothing_are_named(walker: Markers) -> None:
    positions = walker.positions.copy()
    positions[6:] = np.nan
    with pytest.raises(ValueError, match=r"for \d+% of the time no marker is seen"):
        fit_markers(go.human_arm("right"), replace(walker, positions=positions))


@pytest.mark.slow
def test_constant_errors_grow_with_the_uncertainty_of_places(walker: Markers) -> None:
    """In proportion, if offsets are kept; estimates leave less than was unknown before."""
    arm, found = go.human_arm("right", HEIGHT), {}
    for size in (0.01, 0.02):
        used = replace(MMM_MARKERS, uncertainty=size)
        kept = fit_markers(arm, walker, marker_set=used, estimate=(), height=HEIGHT)
        found[size] = kept.constant_errors
    assert found[0.02] == pytest.approx(2.0 * found[0.01], rel=1e-3)
    assert np.all((np.deg2rad(1.0) < found[0.01]) & (found[0.01] < np.deg2rad(20.0)))
    used = replace(MMM_MARKERS, uncertainty=0.02)
    estimated = fit_markers(arm, walker, marker_set=used, estimate="offsets", height=HEIGHT)
    assert np.all(estimated.constant_errors < found[0.02])
