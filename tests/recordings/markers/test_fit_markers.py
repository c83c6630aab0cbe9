"""Motions that are fitted to synthetic markers come back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy
from marked_motion import (
    HEIGHT,
    JOINT_CENTRES,
    MMM_MARKERS,
    PLUG_IN_GAIT_MARKERS,
    angles,
    marked,
    placed,
    walk,
)

import geodesic_ocp as go
from geodesic_ocp.drawing.recording_scenes import fitted_positions
from geodesic_ocp.recordings.markers.fit_markers import fit_markers
from geodesic_ocp.recordings.markers.marker_set import marker_sets
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.tables import text


@pytest.mark.slow
def test_joint_centres_give_the_angles_of_an_arm_at_a_fixed_shoulder() -> None:
    arm, time = go.human_arm("right", HEIGHT), np.arange(120) / 60.0
    q = angles(arm, time)
    places = {
        name: (segment, HEIGHT * np.array(offset))
        for name, (segment, offset) in JOINT_CENTRES.places.items()
        if segment.startswith("right")
    }
    positions = placed(arm, q, places)
    fit = fit_markers(arm, Markers(time, tuple(places), positions), base="fixed", estimate=())
    # What is left is what the prior of small accelerations and jerks takes away.
    assert np.abs(fit.motion.q - q).max() < 0.01
    assert np.nanmax(fit.errors) < 1e-3
    assert fit.motion.trunk is None
    assert fit.base is None
    assert fit.undetermined == ()
    assert fit.height == pytest.approx(HEIGHT)
    # The places of joint centres are certain, so no constant error is left.
    assert not fit.constant_errors.any()
    assert "Constant errors" not in text(fit.table())


@pytest.mark.slow
def test_centres_of_joints_tell_the_lengths_and_so_the_height() -> None:
    arm, time = go.human_arm("right", HEIGHT), np.arange(40) / 20.0
    places = {
        name: (segment, HEIGHT * np.array(offset))
        for name, (segment, offset) in JOINT_CENTRES.places.items()
        if segment.startswith("right")
    }
    positions = placed(arm, angles(arm, time), places)
    fit = fit_markers(
        go.human_arm("right", 1.6), Markers(time, tuple(places), positions), base="fixed"
    )
    assert fit.height == pytest.approx(HEIGHT, rel=0.005)
    assert fit.lengths["right upper arm"] == pytest.approx(0.188 * HEIGHT, rel=0.003)
    assert fit.lengths["right forearm"] == pytest.approx(0.145 * HEIGHT, rel=0.003)
    assert "proportions" in fit.height_from


OPEN = {"REz_joint", "RWx_joint", "RWy_joint"}  # without a point of the hand beside the wrist


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "undetermined"),
    [
        ("joint centres", set()),
        ("HALPE_26", set()),
        ("BODY_25", OPEN),
        ("COCO-17", OPEN),
        ("MediaPipe", set()),
        ("OpenCap", OPEN - {"REz_joint"}),
        ("Rajagopal", OPEN - {"REz_joint"}),
        ("IOR", set()),
    ],
)
@pytest.mark.filterwarnings("ignore:the fit of the markers is doubtful")
def test_known_sets_give_the_angles_of_an_arm_on_a_thorax(
    name: str, undetermined: set[str]
) -> None:
    """They are told by the names of their markers; angles that these leave open are named."""
    arm, time = go.human_arm("right", HEIGHT), np.arange(20) / 20.0
    q = angles(arm, time)
    markers = marked(arm, q, time, marker_sets()[name])
    fit = fit_markers(arm, markers, estimate=(), height=HEIGHT)
    assert fit.marker_set == name
    assert set(fit.undetermined) == undetermined
    known = [joint not in undetermined for joint in arm.joint_names]
    assert np.abs(fit.motion.q - q)[:, known].max() < 0.02
    assert fit.motion.trunk is not None
    assert np.abs(fit.motion.trunk.positions - walk(time).positions).max() < 0.002


@pytest.mark.slow
def test_two_shoulders_and_the_neck_carry_an_arm() -> None:
    """Or two shoulders and a hip; their distance is found, as are the lengths of the arm."""
    arm, time = go.human_arm("right", HEIGHT), np.arange(60) / 30.0
    q = angles(arm, time)
    markers = marked(arm, q, time, JOINT_CENTRES)
    for left_out in ({"right hip", "left hip"}, {"neck", "left hip"}):
        kept = [k for k, name in enumerate(markers.names) if name not in left_out]
        names = tuple(markers.names[k] for k in kept)
        some = Markers(time, names, markers.positions[:, kept])
        fit = fit_markers(go.human_arm("right", 1.7), some)
        assert fit.height == pytest.approx(HEIGHT, rel=0.02)
        assert fit.lengths["shoulder half width"] == pytest.approx(0.110 * HEIGHT, rel=0.01)
        assert np.sqrt(np.mean((fit.motion.q - q) ** 2)) < 0.05
        away = np.linalg.norm(fitted_positions(fit) - some.positions, axis=2)
        np.testing.assert_allclose(away, fit.errors, atol=1e-9)
    names = ("right shoulder", "left shoulder", "right elbow")
    with pytest.raises(ValueError, match="such as both shoulders and the neck or a hip"):
        fit_markers(arm, Markers(time, names, markers.positions[:, :3]))


@pytest.mark.slow
def test_the_model_s_frames_may_be_recorded_by_their_names() -> None:
    arm, time = go.human_arm("left"), np.arange(60) / 60.0
    q = angles(arm, time)
    names = ("LEx_joint", "LWx_joint", "hand")
    positions = np.stack([arm.frame_pose(name, q)[1] for name in names], axis=1)
    with pytest.warns(RuntimeWarning, match="do not determine"):
        fit = fit_markers(arm, Markers(time, names, positions), base="fixed", estimate=())
    assert np.nanmax(fit.errors) < 1e-3
    # One point of the hand leaves the hand's orientation open.
    assert fit.undetermined
    assert set(fit.undetermined) <= {"LEz_joint", "LWx_joint", "LWy_joint"}


@pytest.mark.slow
def test_noise_gaps_and_swapped_markers_leave_the_motion_as_it_is() -> None:
    arm, time = go.human_arm("left", HEIGHT), np.arange(180) / 100.0
    q = angles(arm, time)
    markers = marked(arm, q, time, MMM_MARKERS, noise=1e-3)
    column = {name: markers.names.index(name) for name in markers.names}
    positions = markers.positions.copy()
    positions[60:75, column["LHTS"]] = np.nan
    positions[100:112, [column[f"L{name}"] for name in ("HTS", "HPS", "IFD")]] = np.nan
    swapped = [column["LWTS"], column["LWPS"]]
    positions[130:160, swapped] = positions[130:160, swapped[::-1]]
    fit = fit_markers(arm, replace(markers, positions=positions), estimate=())
    error = np.abs(fit.motion.q - q)
    assert np.sqrt(np.mean(error**2)) < 0.005
    assert error.max() < 0.03
    away = np.linalg.norm(arm.hand_pose(fit.motion.q)[1] - arm.hand_pose(q)[1], axis=1)
    assert away.mean() < 0.002
    assert away.max() < 0.006
    rotations = walk(time).rotations
    assert fit.motion.trunk is not None
    turned = np.swapaxes(fit.motion.trunk.rotations, 1, 2) @ rotations
    angle = scipy.spatial.transform.Rotation.from_matrix(turned).magnitude()
    assert angle.max() < 0.01
    assert np.abs(fit.motion.trunk.positions - walk(time).positions).max() < 0.002
    found = {(each.marker, each.near) for each in fit.lost}
    assert found == {("LWTS", "LWPS"), ("LWPS", "LWTS")}
    for each in fit.lost:
        assert each.start == pytest.approx(1.3)
        assert each.end == pytest.approx(1.59)


@pytest.mark.slow
def test_lengths_and_offsets_are_found() -> None:
    time = np.arange(200) / 40.0
    arm = go.human_arm("right", HEIGHT)
    q = angles(arm, time)
    segment, (x, y, z) = MMM_MARKERS.places["RHTS"]
    moved = {**MMM_MARKERS.places, "RHTS": (segment, (x + 0.006, y - 0.004, z + 0.003))}
    markers = marked(arm, q, time, replace(MMM_MARKERS, places=moved), noise=1e-3)
    # The model starts from another height: lengths and height come from the markers alone.
    fit = fit_markers(go.human_arm("right", 1.7), markers)
    assert fit.height == pytest.approx(HEIGHT, rel=0.02)
    assert fit.lengths["right upper arm"] == pytest.approx(0.188 * HEIGHT, rel=0.03)
    assert fit.lengths["right forearm"] == pytest.approx(0.145 * HEIGHT, rel=0.03)
    assert fit.motion.subject.height == fit.height
    place = HEIGHT * np.array(moved["RHTS"][1])
    assert np.linalg.norm(fit.offsets["RHTS"] - place) < 0.008  # of the 14 mm
    assert np.nanmean(fit.errors) < 0.002
    assert np.sqrt(np.mean((fit.motion.q - q) ** 2)) < 0.05
    # The fitted model with its lengths places the wrist as the arm did.
    _, wrist = arm.frame_pose("right hand", q)
    _, fitted = fit.model.frame_pose("right hand", fit.motion.q)
    assert np.abs(fitted - wrist).max() < 0.02


@pytest.mark.slow
def test_the_result_hardly_depends_on_the_sampling_rate() -> None:
    arm = go.human_arm("right", HEIGHT)
    fits = []
    for rate in (50, 200):
        time = np.arange(2 * rate + 1) / rate
        markers = marked(arm, angles(arm, time), time, MMM_MARKERS)
        fits.append(fit_markers(arm, markers, estimate=(), jerk=20.0))
    slow, fast = (fit.motion.q for fit in fits)
    smoothed = np.abs(slow - angles(arm, fits[0].motion.time)).max()
    assert smoothed > 0.02  # so small a jerk distorts the motion visibly, and equally
    assert np.abs(fast[::4] - slow).max() < 0.1 * smoothed


@pytest.mark.slow
def test_samples_may_be_unevenly_spaced() -> None:
    arm = go.human_arm("right", HEIGHT)
    time = (np.arange(150) + np.random.default_rng(3).uniform(-0.4, 0.4, 150)) / 75.0
    q = angles(arm, time)
    fit = fit_markers(arm, marked(arm, q, time, MMM_MARKERS), estimate=())
    assert np.abs(fit.motion.q - q).max() < 0.01


@pytest.mark.slow
def test_limits_hold_unless_they_are_left_out() -> None:
    arm, time = go.human_arm("right", HEIGHT), np.arange(20) / 20.0
    q = angles(arm, time)
    markers = marked(arm, q, time, MMM_MARKERS)
    narrow = arm.with_limits(upper={"REx_joint": float(np.median(q[:, 3]))})
    kept = fit_markers(narrow, markers, estimate=()).motion.q
    assert np.all(kept <= narrow.upper)
    assert np.all(kept >= narrow.lower)
    free = fit_markers(narrow, markers, estimate=(), limits=False).motion.q
    assert np.abs(free - q).max() < 0.01


@pytest.mark.slow
def test_markers_of_plug_in_gait_at_unknown_offsets() -> None:
    arm, time = go.human_arm("right", HEIGHT), np.arange(200) / 40.0
    q = angles(arm, time)
    random = np.random.default_rng(5)
    places = {
        name: (segment, tuple(np.array(offset) + random.normal(0.0, 0.006, 3)))
        for name, (segment, offset) in PLUG_IN_GAIT_MARKERS.places.items()
    }
    used = replace(PLUG_IN_GAIT_MARKERS, places=places)
    markers = marked(arm, q, time, used, noise=1e-3)
    fit = fit_markers(arm, markers, height=HEIGHT)
    assert fit.marker_set == "Plug-in Gait"
    assert np.nanmean(fit.errors) < 0.003
    # A constant error per joint is what unknown offsets leave; the motion itself comes back.
    change = (fit.motion.q - fit.motion.q.mean(axis=0)) - (q - q.mean(axis=0))
    assert np.sqrt(np.mean(change**2)) < 0.05
    # It is as large as the fit says; so are the errors without estimated offsets, which are larger.
    constant = (fit.motion.q - q).mean(axis=0)
    assert np.all(np.abs(constant) < 3.0 * fit.constant_errors)
    assert np.sqrt(np.mean((constant / fit.constant_errors) ** 2)) < 1.5
    assert "Constant errors of the angles are possible" in text(fit.table())


def test_wrong_arguments_are_named() -> None:
    arm, time = go.human_arm("right"), np.arange(10) / 10.0
    unknown = Markers(time, ("nose",), np.zeros((10, 1, 3)))
    elbow = Markers(time, ("right elbow", "right wrist"), np.zeros((10, 2, 3)))
    with pytest.raises(ValueError, match="nose"):
        fit_markers(arm, unknown)
    with pytest.raises(ValueError, match="three markers"):
        fit_markers(arm, elbow)
    with pytest.raises(ValueError, match="base"):
        fit_markers(arm, elbow, base="moving")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="estimate"):
        fit_markers(arm, elbow, base="fixed", estimate=("mass",))
    with pytest.raises(ValueError, match="noise"):
        fit_markers(arm, elbow, base="fixed", noise=0.0)
    missing = replace(elbow, positions=np.full((10, 2, 3), np.nan))
    with pytest.raises(ValueError, match="no marker"):
        fit_markers(arm, missing, base="fixed")
    near = replace(elbow, time=np.where(time == time[4], time[3] + 1e-6, time))
    with pytest.raises(ValueError, match="samples 3 and 4"):
        fit_markers(arm, near, base="fixed")
    with pytest.raises(ValueError, match="height"):
        fit_markers(arm, elbow, base="fixed", height=180.0)


def test_markers_in_millimetres_or_of_the_other_arm_are_not_fitted_in_silence() -> None:
    arm, time = go.human_arm("right", HEIGHT), np.arange(30) / 30.0
    markers = marked(arm, angles(arm, time), time, MMM_MARKERS)
    in_millimetres = replace(markers, positions=1e3 * markers.positions)
    with pytest.raises(ValueError, match="are the numbers mm or cm"):
        fit_markers(arm, in_millimetres, height=HEIGHT)
    with pytest.raises(ValueError, match="none of the joints of 'human left arm'"):
        fit_markers(go.human_arm("left"), markers)


@pytest.mark.slow
def test_a_solver_that_stops_early_is_an_error() -> None:
    arm, time = go.human_arm("right", HEIGHT), np.arange(30) / 30.0
    markers = marked(arm, angles(arm, time), time, MMM_MARKERS)
    with pytest.raises(go.NotConverged, match="no motion was fitted"):
        fit_markers(arm, markers, ipopt={"max_iter": 1})
