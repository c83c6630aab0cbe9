"""Statistics over the subjects of many recordings: means, paired tests, tables and figures."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from geodesic_ocp.arrays import Array, as_choice
from geodesic_ocp.figures import save_figure
from geodesic_ocp.manifold.metrics import KINETIC_ENERGY, STRAIGHT_LINES
from geodesic_ocp.records import write_together
from geodesic_ocp.studies.joint_inertias import inertia_table, scaling_table
from geodesic_ocp.studies.paired_test import (
    as_confidence,
    holm,
    paired_test,
    rank_biserial,
    student_half,
)
from geodesic_ocp.studies.sources import alike, may_be_one
from geodesic_ocp.studies.study_tables import doubtful_recordings, key_of, new_rows
from geodesic_ocp.synergies.second_order import SECOND_ORDER
from geodesic_ocp.tables import latex, markdown

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame, Series


class StudyMeasure(NamedTuple):
    """A quantity of every recording and method: its column, header, axis label, and axis scale."""

    column: str
    header: str
    axis: str
    scale: float = 1.0

    @property
    def unit(self) -> str:
        """The unit in brackets after a space, as in " [rad]"; empty where there is none."""
        return "".join(re.findall(r" \[.*\]$", self.header))


_ERRORS = {  # what has them, their unit, and name and unit of their axis
    "joint": ("joints", "rad", "joint error", "rad"),
    "position": ("hand", "m", "hand position error", "mm"),
    "orientation": ("hand", "rad", "hand orientation error", "rad"),
}
_PER_SECOND = "segments per second [1/s]"
MEASURES = {
    f"{name}{suffix}": StudyMeasure(
        f"{name}_error{suffix}_{unit}",
        f"{what}{remark} [{unit}]",
        f"{axis}{remark} [{shown}]",
        1.0 if shown == unit else 1000.0,
    )
    for suffix, remark in (("", ""), ("_unfiltered", ", unfiltered"))
    for name, (what, unit, axis, shown) in _ERRORS.items()
} | {
    "segments": StudyMeasure("segments", "segments", "number of segments"),
    "segments_per_second": StudyMeasure("segments", _PER_SECOND, _PER_SECOND),
}
ERRORS_SHOWN = ("joint", "position", "orientation")
_OWN = "riemannian"
_FIRST_ORDER = (
    _OWN,
    "joint_inertia",
    "kinetic_energy",
    "euclidean_same_segments",
    "euclidean",
    "ik",
)
_ORDER = (*_FIRST_ORDER, *map(key_of, SECOND_ORDER))
# Methods of second order are compared with those that receive the same.
_COUNTERPARTS = {
    key_of(name): key_of(each.counterpart)
    for name, each in SECOND_ORDER.items()
    if each.counterpart is not None
}
_RECEIVED = [
    "Riemannian cubics and minimum acceleration also receive the directions of the velocities at "
    "the segments' ends, splines only the configurations there."
]
_LIKE_FOR_LIKE = f"{STRAIGHT_LINES}, same segments"
_LEVELS = (0.25, 0.5, 0.75)
_ROUNDING = 1e-12  # of the size of numbers that are equal
_DOTS = 300.0  # [1/inch] of .png
_KINDS = {
    "file": "file that cannot be used",
    "solver": "solver that failed",
    "process": "process that died",
    "same": "same motion as another recording",
    "missing": "not analysed yet",
    "passive": "passive arm, in which no joint moves by more than 20 deg",
}


def as_measure(name: str) -> StudyMeasure:
    """Return the measure of this name.

    Raises:
        ValueError: there is none.
    """
    return MEASURES[as_choice("measure", name, MEASURES)]


def in_natural_order(names: Iterable[str]) -> list[str]:
    """Return names with the numbers in them in order: S2 before S10."""

    def key(name: str) -> tuple[list[tuple[bool, int, str]], str]:
        parts = re.split(r"([0-9]+)", name)
        return [(not p.isdigit(), int(p) if p.isdigit() else 0, p) for p in parts if p], name

    return sorted(set(names), key=key)


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + "s" * (number != 1)


class _Pairs(NamedTuple):
    """Means (k, 2) of k subjects of a method under a condition and of its reference."""

    condition: str
    method: str
    against: str
    means: Array
    left_out: set[str]


@dataclass(frozen=True, eq=False, repr=False)
class StudyResult:
    """Recordings of several subjects, analysed; see `study`.

    All means, intervals and tests are over the means of subjects, so that each subject counts the
    same. In tables NaN is a number that does not exist; `attrs["note"]` says what limits them.

    Attributes:
        recordings: one row for each recording and method, see `geodesic_ocp.studies.study_tables`.
        synergies: one row for each synergy; None if there is no such table.
        failures: one row for each recording that was left out of the analysis.
        by: column whose values are conditions; None for a single condition.
        profiles: one row for each recording and joint inertia; None if they were not computed.
    """

    recordings: DataFrame
    synergies: DataFrame | None = None
    failures: DataFrame = field(default_factory=lambda: new_rows([], "failures"))
    by: str | None = None
    profiles: DataFrame | None = None

    def __repr__(self) -> str:
        counts = [
            f"{_count(self.recordings['recording'].nunique(), 'recording')} of "
            f"{_count(len(self.subjects), 'subject')}",
            _count(len(self.methods), "method"),
        ]
        if self.synergies is not None:
            counts.append(f"{len(self.synergies)} synergies")
        if self.by:
            counts.append(f"{len(self.conditions)} conditions ({self.by})")
        if len(self.failures):
            counts.append(_count(len(self.failures), "failure"))
        return f"StudyResult({', '.join(counts)})"

    def _repr_markdown_(self) -> str:
        return markdown(self.means())

    @cached_property
    def _rows(self) -> DataFrame:
        """The recordings in natural order, each with the name of a subject and a condition."""
        from pandas import Categorical

        rows = self.recordings
        by = self.by
        rows = rows.assign(subject=_subjects(rows), condition=conditions_of(rows, by))
        rows = rows.sort_values("recording", kind="stable").reset_index(drop=True)
        order = {name: in_natural_order(rows[name]) for name in ("condition", "subject")}
        categories = {
            name: Categorical(rows[name], own, ordered=True)
            for name, own in {"method": [*self.methods], **order}.items()
        }
        return rows.assign(**categories)

    @property
    def subjects(self) -> tuple[str, ...]:
        """Names of all persons."""
        return tuple(in_natural_order(_subjects(self.recordings)))

    @property
    def conditions(self) -> tuple[str, ...]:
        """Values of the column `by`; a single empty one if it is None."""
        return tuple(in_natural_order(conditions_of(self.recordings, self.by)))

    @cached_property
    def methods(self) -> dict[str, str]:
        """Label of each method by its key; the key itself if the label depends on the condition."""
        found = labels_of(self.recordings).groupby(self.recordings["method"]).unique()
        order = sorted(found.index, key=lambda key: (*(key != known for known in _ORDER), key))
        labels = {key: found[key][0] if len(found[key]) == 1 else key for key in order}
        count = Counter(labels.values())
        return {key: f"{name} ({key})" if count[name] > 1 else name for key, name in labels.items()}

    def _column(self, measure: str) -> Series:
        """Return a measure of every row of `_rows`; NaN where it is not known.

        Errors over a part of the segments are not: no other method's errors are over this part.
        """
        chosen = as_measure(measure)
        rows = self._rows
        values = rows[chosen.column].astype(float)
        if chosen.column != "segments":
            values = values.where(~self._is_partial)
        if measure == "segments_per_second":
            values = values / rows["duration_s"].where(rows["duration_s"] > 0.0)
        return values.where(np.isfinite(values))

    @cached_property
    def _is_partial(self) -> Series:
        """Whether some segments of a row of `_rows` have no geodesic."""
        lacking = self._rows["segments_found"] < self._rows["segments"]
        return lacking.fillna(False).astype(bool)

    def _values(self, measure: str) -> DataFrame:
        """Return the rows that have a measure, in the column `value`.

        Raises:
            ValueError: an unknown measure, or one that the table does not have.
        """
        known = self._rows.assign(value=self._column(measure)).dropna(subset="value")
        if known.empty:
            raise ValueError(f"measure {measure!r}: the table has no {MEASURES[measure].column}")
        return known

    def known(self, measures: Iterable[str]) -> list[str]:
        """Return the measures that any recording has."""
        return [each for each in measures if self._column(each).notna().any()]

    def means(self, *measures: str, confidence: float = 0.95, complete: bool = False) -> DataFrame:
        """Return mean over subjects of the subjects' means, of every method under every condition.

        Args:
            measures: "joint", "position", "orientation", these with "_unfiltered" (errors against
                the unfiltered recording), "segments" or "segments_per_second"; by default errors of
                joints and hand.
            confidence: confidence of the intervals by Student's t.
            complete: only recordings in which no method lacks the measure, so that methods are
                compared on the same recordings.

        Raises:
            ValueError: an unknown measure, or one that the tables do not have; with complete, no
                recording has all methods.
        """
        from pandas import concat

        as_confidence(confidence)
        names = measures or self.known(ERRORS_SHOWN) or ERRORS_SHOWN[:1]
        parts = {as_measure(each).header: self._means(each, confidence, complete) for each in names}
        found = concat(parts, names=["measure"])
        counts = found[["subjects", "recordings"]].drop_duplicates()
        unequal = ["Methods are not all averaged over the same recordings."]
        sentences = [
            "Means over subjects of the subjects' means. SD: standard deviation over subjects. "
            "Intervals: of the mean, by Student's t, within 0 and above, of three or more.",
            *(unequal if len(counts) > 1 else []),
            *(_RECEIVED if {*_COUNTERPARTS} & {*self.methods} else []),
            *self.notes,
        ]
        found.attrs["note"] = " ".join(sentences)
        return found

    def _means(self, measure: str, confidence: float, complete: bool) -> DataFrame:
        rows = self._values(measure)
        keys = ["condition", "method"]
        if complete:
            count = rows.groupby("recording")["method"].transform("nunique")
            rows = rows[count == rows["method"].nunique()]
            if rows.empty:
                raise ValueError(f"complete: no recording has {measure!r} of all methods")
        subjects = _subject_means(rows, keys).groupby(keys, observed=True)
        found = subjects.agg(subjects="size", mean="mean", SD="std")
        recordings = rows.groupby(keys, observed=True)["recording"].nunique()
        total = self._rows.groupby("condition", observed=True)["recording"].nunique()
        found.insert(1, "recordings", recordings)
        total = found.index.get_level_values("condition").map(total).astype(int)
        found.insert(2, "missing", total - recordings)
        half = student_half(found["SD"], found["subjects"], confidence)
        ends = {"low": (found["mean"] - half).clip(lower=0.0), "high": found["mean"] + half}
        found = found.assign(**{f"{confidence:.0%} {end}": own for end, own in ends.items()})
        return self._by_condition(_plain(found).rename(index=self.methods, level="method"))

    def _by_condition(self, table: DataFrame) -> DataFrame:
        """Return the table without the level of the condition if there is only one."""
        named = table.rename_axis(index={"condition": self.by or "condition"})
        return named if self.by else named.droplevel("condition")

    def by_subject(self, measure: str = "joint") -> DataFrame:
        """Return mean over the recordings of each subject (row), of every method (column).

        Raises:
            ValueError: an unknown measure, or one that the tables do not have.
        """
        means = _subject_means(self._values(measure), ["condition", "method"]).unstack("method")
        means.columns = [self.methods[key] for key in means.columns]
        everybody = self._rows.groupby(["condition", "subject"], observed=True)["recording"]
        found = everybody.nunique().to_frame("recordings").join(means)
        found = self._by_condition(_plain(found))
        header = MEASURES[measure].header
        note = " ".join([f"Means of the subject's recordings: {header}.", *self._caveats])
        found.attrs["note"] = note
        return found

    def tests(
        self,
        measure: str = "joint",
        against: str | None = None,
        *,
        confidence: float = 0.95,
        seed: int = 0,
    ) -> DataFrame:
        """Return paired tests over subjects of all methods against one, or of conditions against
        one.

        A pair is a subject's means over the recordings that both methods have, or under both
        conditions. Means that differ by less than 1e-12 of their size are equal. P-values of
        Wilcoxon's test are corrected by Holm's method for the number of tests in the table. The
        effect is the matched-pairs rank-biserial correlation, see `rank_biserial`.

        Args:
            measure: see `means`.
            against: a method, by key or label, or a condition; by default straight lines on the
                same segments, and for methods of second order their counterparts in a constant
                metric, which receive the same.
            confidence, seed: confidence and seed of the bootstrap interval of the mean difference,
                see `paired_test`.

        Raises:
            ValueError: an unknown measure, method or condition.
        """
        return self._tests(measure, against, self._pairs(measure, against), confidence, seed)

    def _tests(
        self,
        measure: str,
        against: str | None,
        pairs: Sequence[_Pairs],
        confidence: float = 0.95,
        seed: int = 0,
    ) -> DataFrame:
        from pandas import DataFrame

        _, key = self._reference(against)
        columns = [
            *("condition", "method", "against"),
            *("subjects", "left out", "smaller in", "larger in"),
            f"mean difference{MEASURES[measure].unit}",
            *(f"{confidence:.0%} {end}" for end in ("low", "high")),
            *("effect", "sign test p", "Wilcoxon p"),
        ]
        rows = []
        notes = []
        most = 0
        for each in pairs:
            a, b = each.means.T
            b = np.where(np.isclose(a, b, rtol=_ROUNDING, atol=0.0), a, b)
            test = paired_test(a, b, confidence=confidence, seed=seed)
            most = max(most, test.pairs)
            notes.append(test.note)
            rows.append(
                (
                    *(each.condition, each.method, self.methods.get(each.against, each.against)),
                    *(test.pairs, len(each.left_out), test.wins, test.losses),
                    *(test.mean_difference, *test.interval, rank_biserial(a - b)),
                    *(test.sign_p, test.wilcoxon_p),
                )
            )
        found = DataFrame(rows, columns=columns).set_index(["condition", "method"])
        found["p, Holm"] = holm(found["Wilcoxon p"])
        found = self._by_condition(found.rename(index=self.methods, level="method"))
        note = [
            "Pairs are subjects. Intervals: of the mean difference, by bootstrap. Effect: "
            "matched-pairs rank-biserial correlation, positive where numbers are smaller than the "
            "reference's. P-values: two-sided; the last column is Wilcoxon's, corrected for "
            f"{_count(len(rows), 'test')} by Holm's method."
        ]
        if not rows:
            note = [f"No subject can be compared with {self.methods.get(key, key)}."]
        elif most == 1:
            note.append("One subject only: there is nothing to test.")
        else:
            note += dict.fromkeys(f"{each[:1].upper()}{each[1:]}." for each in notes if each)
        if names := in_natural_order(name for each in pairs for name in each.left_out):
            note.append(f"Left out, without a pair: {', '.join(names)}.")
        found.attrs["note"] = " ".join([*note, *self._caveats])
        return found

    def _pairs(self, measure: str, against: str | None) -> list[_Pairs]:
        """Return the subjects' means of each condition and method, and those of the reference."""
        is_method, key = self._reference(against)
        compared = "condition"
        same = ["method", "subject"]
        if is_method:
            compared = "method"
            same = ["condition", "subject", "recording"]
        groups = self._values(measure).groupby([*same, compared], observed=True)
        table = groups["value"].mean().unstack(compared).astype(float)
        people = self._rows.groupby("condition", observed=True)["subject"].unique().map(set)
        found = {}
        own_references = dict.fromkeys(table.columns, key)
        if against is None:
            own_references |= {**_COUNTERPARTS, **{each: each for each in _COUNTERPARTS.values()}}
        for each, reference in own_references.items():
            if each == reference or not {each, reference} <= {*table.columns}:
                continue
            means = table[[each, reference]].dropna().groupby(same[:2], observed=True).mean()
            for other, own in means.groupby(level=0, observed=True):
                condition, method = (other, each) if is_method else (each, other)
                everybody = people[condition] | (set() if is_method else people[reference])
                left_out = everybody - {*own.index.get_level_values("subject")}
                found[condition, method] = _Pairs(
                    condition, method, reference, own.to_numpy(), left_out
                )
        order = product(self.conditions, self.methods)
        return [found[place] for place in order if place in found]

    def _reference(self, against: str | None) -> tuple[bool, str]:
        """Return whether the reference is a method, not a condition, and its key."""
        wanted = _LIKE_FOR_LIKE if against is None else against
        for key, label in self.methods.items():
            if wanted in (key, label, label.removesuffix(f" ({key})")):
                return True, key
        conditions = self.conditions if self.by else ()
        if wanted in conditions:
            return False, wanted
        known = ", ".join(map(repr, (*self.methods, *conditions)))
        raise ValueError(f"against must be one of {known}, got {against!r}")

    def synergy_statistics(self) -> DataFrame:
        """Return numbers, durations and lengths of the synergies of each subject, by condition.

        Segments at rest count as synergies. Quartiles are over all synergies of a subject; the last
        row of several subjects has the means over them.

        Raises:
            ValueError: there is no table of synergies.
        """
        from pandas import concat

        if self.synergies is None:
            raise ValueError("the study has no table of synergies (synergies.csv)")
        keys = ["condition", "subject"]
        each = self._rows.drop_duplicates("recording").groupby(keys, observed=True)
        synergies = self.synergy_rows.groupby(keys)
        found = _plain(each.agg(recordings=("recording", "size"), seconds=("duration_s", "sum")))
        found["synergies"] = synergies.size().reindex(found.index, fill_value=0)
        found["per recording"] = found["synergies"] / found["recordings"]
        seconds = found.pop("seconds")
        found["per second [1/s]"] = found["synergies"] / seconds.where(seconds > 0.0)
        for column, name, unit in (
            ("duration_s", "duration", "s"),
            ("length", "length", self.length_unit),
        ):
            for level in _LEVELS:
                header = f"{name}, {level:.0%}" + f" [{unit}]" * bool(unit)
                found[header] = synergies[column].quantile(level).reindex(found.index)
        parts = []
        for condition, own in found.groupby("condition", observed=True):
            means = own.mean().to_frame((condition, "mean over subjects")).T
            parts += [own, means] if len(own) > 1 else [own]
        found = concat([part.astype(object) for part in parts]).rename_axis(
            [self.by or "condition", "subject"]
        )
        found = found if self.by else found.droplevel(0)
        found.attrs["note"] = " ".join(["Segments at rest count as synergies.", *self._caveats])
        return found

    def joint_inertia(self, *, confidence: float = 0.95, seed: int = 0) -> DataFrame:
        """Return the joint inertia with which geodesics are nearest to each subject's recordings.

        The estimate minimizes the mean over the subject's recordings of the squared error, on their
        interpolated profiles. Its interval is the percentile bootstrap over the recordings. The
        last row of several subjects is the geometric mean over them, with an interval by Student's
        t of the logarithms.

        Args:
            confidence, seed: confidence of the intervals, and seed of the bootstrap.

        Raises:
            ValueError: there are no profiles, see `analyse_recordings`.
        """
        table = inertia_table(self._profiles, as_confidence(confidence), seed)
        if missing := self._rows["recording"].nunique() - self._profiles["recording"].nunique():
            table.attrs["note"] += f" {_count(missing, 'recording')} without a profile."
        return self._with_caveats(table)

    def scaling(self, *, confidence: float = 0.95) -> DataFrame:
        """Return whether the subjects' joint inertia is proportional to m r^2.

        The exponent b of joint inertia [kg m^2] ~ (m r^2)^b is the slope of their logarithms by
        least squares. It is tested against 1, proportional, and 0, the same for everybody;
        p-values are corrected by Holm's method for the tests in the table. Subjects whose height or
        mass is assumed, or given by an option for all, are left out: an estimate is relative to
        m r^2, so that a wrong one makes the joint inertia appear proportional to it.

        Args:
            confidence: confidence of the interval.

        Raises:
            ValueError: there are no profiles, see `analyse_recordings`.
        """
        return self._with_caveats(scaling_table(self._profiles, as_confidence(confidence)))

    @cached_property
    def _profiles(self) -> DataFrame:
        """Rows of the profiles, each with what is known of its recording."""
        if self.profiles is None:
            raise ValueError(
                "the study has no profiles of the joint inertia (profiles.csv): analyse with "
                "--study, or analyse_recordings(..., fit=True)"
            )
        known = self._rows.drop_duplicates("recording").set_index("recording")
        facts = known[["condition", "subject", "height_m", "mass_kg"]].assign(
            assumed=known[["height_from", "mass_from"]].isin(("assumed", "given")).any(axis=1),
        )
        return self.profiles.drop(columns="subject").join(facts, on="recording", how="inner")

    def _with_caveats(self, table: DataFrame) -> DataFrame:
        """Return a table by curve and condition without levels of one value, with all its notes."""
        note = " ".join([table.attrs["note"], *self._caveats])
        if table.index.unique("curve").size == 1:
            table = table.droplevel("curve")
        table = self._by_condition(table)
        table.attrs["note"] = note
        return table

    @cached_property
    def synergy_rows(self) -> DataFrame:
        """Rows of the synergies, each with the condition of its recording."""
        assert self.synergies is not None
        condition = self._rows.drop_duplicates("recording").set_index("recording")["condition"]
        rows = self.synergies.assign(subject=_subjects(self.synergies))
        return rows.assign(condition=rows["recording"].map(condition.astype(str)))

    @property
    def length_unit(self) -> str:
        """Unit of the synergies' lengths; empty if it is not known."""
        label = self.methods.get(_OWN, "")
        if STRAIGHT_LINES in label:
            return "rad"
        return "sqrt(kg) m" if KINETIC_ENERGY in label else ""

    @property
    def notes(self) -> tuple[str, ...]:
        """The limits of the study, in sentences: failures, one subject only, missing methods."""
        rows = self._rows
        notes = []
        if len(self.failures):
            kinds = Counter(_KINDS.get(kind, "other error") for kind in self.failures["kind"])
            why = "; ".join(f"{kind}: {number}" for kind, number in sorted(kinds.items()))
            left_out = _count(len(self.failures), "recording")
            notes.append(f"{left_out} left out of the analysis ({why}).")
        total = rows["recording"].nunique()
        partial = self._is_partial
        for method, label in self.methods.items():
            own = rows["method"] == method
            known = rows.loc[own & rows["joint_error_rad"].notna() & ~partial, "recording"]
            if missing := total - known.nunique():
                notes.append(f"{label}: no result in {missing} of {_count(total, 'recording')}.")
            if (some := rows[own & partial & rows["joint_error_rad"].notna()]).size:
                found = f"{some['segments_found'].sum()} of {some['segments'].sum()} segments"
                notes.append(
                    f"{len(some)} of these have geodesics for {found}; their errors over those, in "
                    "the table of recordings, are no part of means and tests."
                )
        notes += [*self._caveats, *self._spread]
        notes += doubtful_recordings(rows.drop_duplicates("recording").to_dict("records"))
        notes += [f"{may_be_one(names)}." for names in alike(self.subjects)]
        if len(self.subjects) == 1:
            notes.append("One subject only: there is no spread over subjects, and nothing to test.")
        settings = set(rows["settings"]) - {""}
        if len(settings) > 1:
            notes.append(f"The recordings were analysed with {len(settings)} different settings.")
        if self.synergies is None:
            notes.append("There is no table of synergies.")
        return tuple(notes)

    @property
    def _caveats(self) -> list[str]:
        """A sentence, if files stand for persons in some of several recordings."""
        rows = self.recordings.drop_duplicates("recording")
        nameless = rows["subject"] == ""
        by_file = ~nameless & (rows["subject_from"] == "file name")
        if by_file.any() and len(rows) > 1:
            return [
                f"Subjects of {(nameless | by_file).sum()} of {_count(len(rows), 'recording')} are "
                "named after files: several recordings of one person may be counted as several "
                "subjects. State the subjects with a table or by the paths, see `analyse`."
            ]
        if nameless.any():
            number = _count(int(nameless.sum()), "recording")
            return [
                f"{number} without the name of a subject: each file counts as a subject of its own."
            ]
        return []

    @property
    def _spread(self) -> list[str]:
        """A sentence on the recordings whose analysis states its uncertainty, if there are any."""
        rows = self.recordings[self.recordings["segments_low"].notna()]
        if rows.empty:
            return []
        mean = rows.mean(numeric_only=True)
        cuts = int((rows["segments"] - 1).sum())
        return [
            f"With the own noise of each recording ({_count(len(rows), 'recording')}, 90 % of the "
            f"replicates) there are on average {mean['segments_low']:.1f} to "
            f"{mean['segments_high']:.1f} synergies, where the analyses have "
            f"{mean['segments']:.1f}, with joint errors of {mean['joint_error_low_rad']:.2g} to "
            f"{mean['joint_error_high_rad']:.2g} rad, where they have "
            f"{mean['joint_error_rad']:.2g}; {int(rows['stable_cuts'].sum())} of {cuts} cuts "
            "are stable."
        ]

    def subjects_by_row(self, measure: str) -> tuple[DataFrame, list[Array]]:
        """Return the means of a measure, and the subjects' means (k,) of each of its rows."""
        table = self._means(measure, 0.95, complete=False)
        keys = ["condition", "method"]
        means = _subject_means(self._values(measure), keys).groupby(keys, observed=True)
        return table, [own.to_numpy() for _, own in means]

    def paired_differences(
        self, measure: str = "joint", against: str | None = None
    ) -> tuple[DataFrame, list[Array]]:
        """Return the tests, see `tests`, and the subjects' differences (k,) of each of its rows."""
        pairs = self._pairs(measure, against)
        points = [each.means[:, 0] - each.means[:, 1] for each in pairs]
        return self._tests(measure, against, pairs), points

    def save(
        self,
        folder: str | Path,
        *,
        measure: str = "joint",
        against: str | None = None,
        figures: Mapping[str, Figure] | None = None,
    ) -> list[Path]:
        """Write tables (.csv, .md and .tex), study.md and figures (.pdf and .png) to a folder.

        All are written to a temporary folder first and moved together; their paths are returned.

        Args:
            folder: is created if it does not exist.
            measure, against: measure and against of the tests, see `tests`.
            figures: by name, as `go.drawing.study_figures` draws them; None: none are written.

        Raises:
            ValueError: as `tests`.
            OSError: the folder cannot be created or written to.
        """
        known = self.known(MEASURES)
        tables = {
            "means": ("Means over subjects", self.means(*known)),
            "tests": (f"Paired tests: {MEASURES[measure].header}", self.tests(measure, against)),
        }
        if self.synergies is not None and len(self.synergies):
            tables["synergy_statistics"] = "Synergies by subject", self.synergy_statistics()
        if self.profiles is not None:
            tables["joint_inertia"] = "Joint inertia by subject", self.joint_inertia()
            tables["scaling"] = "Joint inertia against m r^2", self.scaling()
        for name in known:
            tables[f"by_subject_{name}"] = (
                f"By subject: {MEASURES[name].header}",
                self.by_subject(name),
            )

        def write(into: Path) -> None:
            notes = "".join(f"- {note}\n" for note in self.notes)
            parts = [f"# Study\n\n{self!r}\n\n{notes}"]
            for name, (caption, table) in tables.items():
                table.to_csv(into / f"{name}.csv")
                if not name.startswith("by_subject"):
                    text = latex(table, caption, f"tab:{name}")
                    (into / f"{name}.tex").write_text(text, encoding="utf-8")
                    (into / f"{name}.md").write_text(markdown(table), encoding="utf-8")
                    parts.append(f"## {caption}\n\n{markdown(table)}")
            (into / "study.md").write_text("\n".join(parts), encoding="utf-8")
            for name, figure in (figures or {}).items():
                save_figure(figure, into, name, _DOTS)

        return write_together(folder, write)


def _plain(table: DataFrame) -> DataFrame:
    """Return the table with an index of names, in their order, without categories."""
    from pandas import MultiIndex

    levels = [table.index.get_level_values(name).astype(object) for name in table.index.names]
    return table.set_axis(MultiIndex.from_arrays(levels, names=table.index.names))


def _subjects(rows: DataFrame) -> Series:
    """Return the person; where the recording names none, its file, or else the recording itself."""
    named = rows["subject"].where(rows["subject"] != "", rows["file"])
    return named.where(named != "", rows["recording"])


def conditions_of(rows: DataFrame, by: str | None) -> Series:
    """Return the condition of each row; empty without conditions."""
    if by is None:
        return rows["recording"].map(lambda _: "")
    return rows[by].where(rows[by] != "", "not given")


def labels_of(rows: DataFrame) -> Series:
    """Return the label of each row's method."""
    return rows["method_label"].where(rows["method_label"] != "", rows["method"])


def _subject_means(rows: DataFrame, keys: list[str]) -> Series:
    """Return mean over the recordings of each subject that has any."""
    return rows.groupby([*keys, "subject"], observed=True)["value"].mean()
