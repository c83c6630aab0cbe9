"""Playbacks of what is in files, each read by what it is."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, TypeAlias, cast, get_args

import numpy as np
from cyclopts import Parameter

from geodesic_ocp.cli.analyse import analysed
from geodesic_ocp.cli.kinds import REPORT, Kind, file_kind, folder_files
from geodesic_ocp.cli.options import (
    Flag,
    RecordingOptions,
    arms_that_move,
    each_side,
    with_hand_of,
)
from geodesic_ocp.cli.solve import problem_classes
from geodesic_ocp.cli.terminal import printed_warnings
from geodesic_ocp.drawing.alignments import alignment_playback
from geodesic_ocp.drawing.motion_scenes import (
    model_playback,
    motion_playback,
    robots_playback,
    trajectory_playback,
)
from geodesic_ocp.drawing.path_scenes import solution_playback
from geodesic_ocp.drawing.playback_of import playback_of
from geodesic_ocp.drawing.recording_scenes import (
    analysis_playback,
    marked,
    marker_fit_playback,
    saved_synergies_playback,
)
from geodesic_ocp.drawing.scene import Cut, Playback
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.anthropometry import Side, Sides
from geodesic_ocp.model.formats.load_model import default_hand, load_model
from geodesic_ocp.model.formats.robots import ROBOTS, folder
from geodesic_ocp.model.human import DEFAULT_HEIGHT, both_arms, human_arm, human_upper_body, stature
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.load_solution import load_solution
from geodesic_ocp.ocp.solve import solve
from geodesic_ocp.recordings.read_recording import read_markers, read_recording
from geodesic_ocp.recordings.recording_settings import RecordingSettings
from geodesic_ocp.retargeting.arm_alignment import check_joints, read_alignment
from geodesic_ocp.studies.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.result_files import SYNERGIES
from geodesic_ocp.studies.study_tables import read_text_table
from geodesic_ocp.synergies.synergy import SavedSynergies, read_saved_synergies
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.read_trajectory import read_trajectory
from geodesic_ocp.trajectory.recording import Recording

_ROBOTS = Parameter(group="Robots, trajectories, alignments and solutions", show_default=False)
_Found: TypeAlias = tuple[Path | str, Kind]


@dataclass(frozen=True)
class Shown:
    """Options of `geodesic-ocp show` about what is in the files.

    Attributes:
        side: the arm; default: the right one, or the left one if there is no other.
        recording: facts about recordings that their files may not state.
        analyse: cut each recording into synergies first, as geodesic-ocp analyse does by default,
            and show what they predict.
        robot: robot of a trajectory or an alignment: a name (see geodesic-ocp models) or a file
            (URDF, MJCF); twice for two arms, in the order of the trajectory.
        hand: hand (end-effector) frame of robots; default: the last.
        base: fixed frame of robots that is their base.
        problem: Python file of the problem of a solution.
    """

    side: Sides | None = None
    recording: RecordingOptions = RecordingSettings()  # noqa: RUF009
    analyse: Flag = False
    robot: Annotated[Sequence[str], _ROBOTS] = ()
    hand: Annotated[str | None, _ROBOTS] = None
    base: Annotated[str | None, _ROBOTS] = None
    problem: Annotated[Path | None, _ROBOTS] = None

    def playbacks(self, files: Sequence[str]) -> list[Playback]:
        """Return what is in the files, in their order; synergies with their recording, if given.

        Raises:
            ValueError: a file cannot be read or shown; names it.
            NotConverged: a problem has no solution, or no motion fits markers.
        """
        found = list(_found(files))
        recorded = [file for file, kind in found if kind == "recording"]
        synergies = [file for file, kind in found if kind == "synergies"]
        together = len(recorded) == 1 and len(synergies) == 1 and not self.analyse
        playbacks: list[Playback] = []
        for file, kind in found:
            if isinstance(file, str):
                playbacks.append(model_playback(self._robot(file)))
            elif not (together and kind == "recording"):
                with printed_warnings():
                    playbacks += self._of(file, kind, Path(recorded[0]) if together else None)
        return playbacks

    def _of(self, file: Path, kind: Kind, recorded: Path | None) -> Iterator[Playback]:
        if kind == "recording":
            yield from self._recording(file)
        elif kind == "synergies":
            yield self._synergies(file, recorded)
        elif kind == "trajectory":
            yield self._trajectory(file)
        elif kind == "alignment":
            yield self._alignment(file)
        elif kind == "solution":
            yield self._solution(file)
        else:
            yield from (playback_of(solve(each())) for each in problem_classes(file))

    def _robot(self, name: str) -> Model:
        """Return a robot by name or file, with the last link as the hand if none is given."""
        hand = self.hand
        with printed_warnings():
            if hand is None and (hand := default_hand(name)) is not None:
                print(f"note: {name}: the hand is {hand!r}; --hand FRAME chooses another")
            return load_model(name, hand=hand, base=self.base)

    # Recordings

    def _recordings(self, file: Path, side: Sides | None) -> list[Recording]:
        """Return the recording of the arm that is asked for, or of both."""
        if side is not None:
            return [self._read(file, each) for each in each_side(side)]
        try:
            return [self._read(file, "right")]
        except RecordingError as error:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    found = self._read(file, "left")
                except RecordingError:
                    raise error from None
            print(f"note: {file}: the left arm; there is no right one")
            return [found]

    def _read(self, file: Path, side: Side) -> Recording:
        given = self.recording
        return read_recording(file, side, height=given.height, mass=given.mass, **given.reading())

    def _recording(self, file: Path) -> Iterator[Playback]:
        """Yield the motion, both arms in one pane, or the person fitted to the markers."""
        found = self._recordings(file, self.side)
        if self.analyse:
            for recording in found:
                analysis = analysed(recording, AnalysisSettings(), recording.name)
                title = f"{recording.name}: {len(analysis.synergies)} geodesic synergies"
                yield analysis_playback(analysis, title=title)
            return
        if len(found) == 2 and not any(each.fit for each in found):
            yield motion_playback(*_together(*found), title=f"{file.stem}, both arms")
            return
        for recording in found:
            if recording.fit is None:
                yield playback_of(recording, title=recording.name)
            else:
                given = self.recording
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # they were told with the fit
                    markers = read_markers(file, up=given.up, person=given.person)
                yield marker_fit_playback(recording.fit, markers, title=recording.name)

    def _synergies(self, file: Path, recorded: Path | None) -> Playback:
        """Return the motion that synergies predict, over the recorded motion if it is given."""
        saved = read_saved_synergies(file)
        names = set(saved.motion.joint_names)
        title = f"{file.parent.name}/{file.name}" if file.parent.name else file.name
        if recorded is None:
            whole = saved_synergies_playback(saved, self._model_of(file, saved), title=title)
            return _with_marks(whole, file)
        own: Side = "left" if names <= set(human_arm("left").joint_names) else "right"
        (recording, *_) = self._recordings(recorded, self.side or own)
        if set(recording.model.joint_names) != names:
            raise RecordingError(
                f"{file}: its joints {', '.join(saved.motion.joint_names)} are not those of "
                f"{recorded}, which are {', '.join(recording.model.joint_names)}"
            )
        name = f"{recording.name}: {len(saved.spans)} geodesic synergies"
        whole = saved_synergies_playback(saved, recording.model, recording.motion, title=name)
        return _with_marks(whole, file)

    def _model_of(self, file: Path, saved: SavedSynergies) -> Model:
        """Return the model that the file names, or the person with these joints, or --robot."""
        if self.robot:
            return self._robot(self.robot[0])
        names = set(saved.motion.joint_names)
        height = self.recording.height or saved.height
        assumed = DEFAULT_HEIGHT if height is None else height
        people = (human_arm("right"), human_arm("left"), human_upper_body())
        person = next((each for each in people if set(each.joint_names) == names), None)
        if person is not None:
            if height is None:
                print(f"note: {file}: assumed height {assumed} m; --height gives another")
            if person.dof > 7:
                return human_upper_body(assumed)
            return human_arm("left" if "left" in person.name else "right", assumed)
        if _is_installed(saved.model):
            return self._robot(saved.model)
        of = f" of {saved.model!r}" if saved.model else ""
        raise RecordingError(
            f"{file}: has synergies{of}; say which robot it is: --robot NAME or FILE"
        )

    # Robots and solutions

    def _trajectory(self, file: Path) -> Playback:
        """Return the robots that follow a trajectory; two arms of one robot share its body.

        Without --robot, the robots are those of the synergies that retarget wrote beside the file.
        """
        trajectory = read_trajectory(file)
        names = list(self.robot) or _named_beside(file)
        if not names:
            raise RecordingError(
                f"{file}: is a trajectory of {', '.join(trajectory.joint_names[:3])}, ...; say of "
                "which robot: --robot NAME or FILE"
            )
        if self.hand is None:
            names = [*arms_that_move(names, trajectory.joint_names)]
        robots = [self._robot(name) for name in names]
        parts = []
        for robot, part in zip(robots, _parts(file, trajectory, robots), strict=True):
            try:
                parts.append(trajectory_playback(part, robot, title=robot.name))
            except ValueError as error:
                raise RecordingError(f"{file}: {error}") from None
        names = list(dict.fromkeys(robot.name for robot in robots))
        return robots_playback(robots, parts, title=f"{' and '.join(names)}, {file.name}")

    def _alignment(self, file: Path) -> Playback:
        """Return a person's arm, and a robot's arm in corresponding poses."""
        aligned = read_alignment(file)
        if not self.robot:
            raise RecordingError(
                f"{file}: is the alignment of a robot; say of which one: --robot NAME or FILE"
            )
        robot = with_hand_of(self._robot(self.robot[0]), aligned.side)
        try:
            check_joints(aligned, robot)
        except ValueError as error:
            raise RecordingError(f"{file}: {error}") from None
        return alignment_playback(aligned, robot)

    def _solution(self, file: Path) -> Playback:
        """Return a solution that geodesic-ocp solve wrote."""
        if self.problem is not None:
            problem_classes(self.problem)  # load_solution finds the class among those imported
        try:
            return solution_playback(load_solution(file))
        except RecordingError as error:
            if self.problem is not None or "not imported" not in str(error):
                raise
            reason = str(error).partition(";")[0]
            raise RecordingError(
                f"{reason}; give the file that defines it: --problem FILE.py"
            ) from None


def _found(names: Sequence[str]) -> Iterator[_Found]:
    """Yield files with what is in them, those in folders included, and names of robots."""
    for name in names:
        path = Path(name)
        if _is_installed(name):
            if path.is_dir():
                print(f"note: {name} is the robot of that name; the folder is ./{name}")
            yield name, "robot"
        elif path.is_dir():
            found = [(file, file_kind(file)) for file in folder_files(path)]
            if found[0][1] == "trajectory" and len(names) == 1:
                print(
                    f"note: {name}: the robot without the person; both are in {REPORT}, which "
                    "retarget --out and go.drawing.report write and show opens by itself, and "
                    f"where the recording is given, too: geodesic-ocp show RECORDING {name}"
                )
            yield from found
        elif not path.exists():
            if path.suffix and not path.suffix[1:].isdigit():
                raise RecordingError(f"{name}: there is no such file")
            yield name, "robot"
        else:
            kind = file_kind(path)
            if kind == "result":  # of many recordings; the synergies are beside it
                path = path.with_suffix(SYNERGIES)
                kind = "synergies"
            yield (name if kind == "robot" else path), kind


def _together(right: Recording, left: Recording) -> tuple[Motion, Model]:
    """Return both arms of a person as one motion of one model, with the origin between the
    shoulders.
    """
    model = both_arms((right.model, left.model), stature(right.model) or DEFAULT_HEIGHT)
    motions = right.motion, left.motion
    q = np.hstack([each.q for each in motions])
    velocity = np.hstack([np.asarray(each.velocity) for each in motions])
    one = motions[0]
    return Motion(one.time, q, model.joint_names, velocity, one.subject, trunk=one.trunk), model


def _parts(
    file: Path, trajectory: JointTrajectory, robots: Sequence[Model]
) -> Iterator[JointTrajectory]:
    """Yield the trajectory of each robot: its columns follow each other, with any names."""
    dofs = [robot.dof for robot in robots]
    if len(robots) == 1 and set(robots[0].joint_names) <= set(trajectory.joint_names):
        yield trajectory
        return
    if sum(dofs) != len(trajectory.joint_names):
        wanted = " and ".join(f"{robot.name} {robot.dof}" for robot in robots)
        raise RecordingError(
            f"{file}: is a trajectory of {len(trajectory.joint_names)} joints, "
            f"{', '.join(trajectory.joint_names)}; of the robots {wanted}"
        )
    for number, robot in enumerate(robots):
        own = slice(sum(dofs[:number]), sum(dofs[: number + 1]))
        given = trajectory.joint_names[own]
        if not all(a.endswith(b) for a, b in zip(given, robot.joint_names, strict=True)):
            raise RecordingError(
                f"{file}: its joints {', '.join(given)} are not those of {robot.name}, "
                f"{', '.join(robot.joint_names)}"
            )
        yield trajectory.columns(own, robot.joint_names)


def _with_marks(playback: Playback, file: Path) -> Playback:
    """Return the playback of synergies with the marks of their cuts in the table beside the file,
    if there is one.
    """
    table = file.with_name("cuts.csv")
    spans = playback.spans["synergies"]
    if not table.is_file():
        return playback
    names, lines = read_text_table(table)
    columns = dict(zip(names, zip(*(values for _, values in lines), strict=True), strict=False))
    times = tuple(str(float(span.start)) for span in spans[1:])
    if columns.get("cut [s]") != times or not set(columns.get("cut is", ())) <= {*get_args(Cut)}:
        return playback  # the table of another analysis
    return replace(playback, spans={"synergies": marked(spans, cast(Any, columns["cut is"]))})


def _named_beside(file: Path) -> list[str]:
    """Get names of the robots in the files of synergies beside a trajectory, if all are known."""
    one = file.with_name("synergies.json")
    beside = [one] if one.is_file() else sorted(file.parent.glob("synergies_[0-9].json"))
    names = [
        read_saved_synergies(each).model.partition(" with ")[0] for each in beside
    ]  # a payload
    if not names or not all(_is_installed(name) for name in names):
        return []
    print(f"note: {file}: of {' and '.join(names)}, which is named beside it")
    return names


def _is_installed(name: str) -> bool:
    """Return True for the name of a known robot whose package is installed."""
    return name in ROBOTS and folder(ROBOTS[name].package) is not None
