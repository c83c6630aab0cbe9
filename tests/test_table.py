"""Tables as text, Markdown, LaTeX and CSV."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from geodesic_ocp.table import Table


def test_numbers_are_rounded_in_text_and_kept_in_csv() -> None:
    table = Table(("name", "a [m]"), (("one", 0.0123456), ("longer", 7)))
    assert str(table).splitlines() == [
        "name     a [m]",
        "--------------",
        "one     0.0123",
        "longer       7",
    ]
    assert (
        table.markdown() == "| name | a [m] |\n| --- | ---: |\n| one | 0.0123 |\n| longer | 7 |\n"
    )
    assert table.csv() == "name,a [m]\none,0.0123456\nlonger,7\n"


def test_a_table_is_shown_in_a_line() -> None:
    table = Table(("name", "a [m]"), (("one", 0.5), ("two", 7)))
    assert repr(table) == "Table(2 rows: name, a [m])"


def test_latex_has_the_rules_of_booktabs_and_typesets_units_and_numbers() -> None:
    header = ("method", "error [rad]", "length [kg^1/2 m]", "area [m^2, mm]", "share [%]", "test")
    row = ("a_1 & b", -0.5, 1.2e-5, float("nan"), 3, "p < 0.05")
    assert Table((header), (row,), "see `means_of`").latex().splitlines() == [
        r"\begin{tabular}{lrrrrl}",
        r"\toprule",
        r"method & error [$\mathrm{rad}$] & length [$\mathrm{kg^{1/2}\,m}$] & "
        r"area [$\mathrm{m^{2}}$, $\mathrm{mm}$] & share [\%] & test \\",
        r"\midrule",
        r"a\_1 \& b & $-0.500$ & $1.20\times 10^{-5}$ & -- & 3 & p $<$ 0.05 \\",
        r"\bottomrule",
        r"\end{tabular}",
        "",
        r"\medskip{\footnotesize see \texttt{means\_of}\par}",
    ]


def test_latex_with_a_caption_is_a_float_that_can_be_referred_to() -> None:
    lines = Table(("a", "b"), (("x", 1),)).latex("5 % of all", "tab:all").splitlines()
    assert lines[:4] == [
        r"\begin{table}",
        r"\centering",
        r"\caption{5 \% of all}",
        r"\label{tab:all}",
    ]
    assert lines[-1] == r"\end{table}"


def test_a_label_of_latex_needs_a_caption_and_plain_characters() -> None:
    table = Table(("a", "b"), (("x", 1),))
    with pytest.raises(ValueError, match="needs a caption"):
        table.latex(label="tab:x")
    with pytest.raises(ValueError, match="label must be letters"):
        table.latex("errors", r"tab}\input{x")


@given(st.lists(st.text(min_size=0, max_size=12), min_size=1, max_size=4))
def test_no_text_becomes_a_command_of_latex(names: list[str]) -> None:
    text = Table(("name", "b"), tuple((name, 1) for name in names)).latex()
    body = text.split("\\midrule\n")[1].split("\n\\bottomrule")[0]
    rows = body.split("\n")
    assert len(rows) == len(names)
    for row in rows:
        assert row.endswith(r" & 1 \\")
        cell = row.removesuffix(r" & 1 \\")
        known = re.compile(
            r"\\text(?:backslash|asciitilde|asciicircum|asciigrave)\{\}|\\[{}$&#%_]"
            r"|\$(?:[<>|]|\^[23]|\^?\\(?:pm|times|cdot|le|ge|approx|circ|infty|mu)|-)\$"
            r"|\$-?[\d.]+(?:\\times 10\^\{-?\d+\})?\$|^\{\}"
        )
        assert not set(known.sub("", cell)) & set("\\{}$&#%_~^\n\r")
        assert not cell.startswith(("[", "*"))
