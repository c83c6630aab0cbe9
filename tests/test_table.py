"""Tables as text, Markdown, LaTeX and HTML."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.tables import html, latex, markdown, new_table, text

TABLE = new_table(("name", "a [m]"), (("one", 0.0123456), ("longer", 7)), "All of them.")


def test_numbers_are_rounded_where_they_are_shown_and_kept_in_csv() -> None:
    assert text(TABLE).splitlines() == [
        "name      a [m]",
        "------  -------",
        "one      0.0123",
        "longer        7",
        "",
        "All of them.",
    ]
    assert markdown(TABLE).splitlines()[2] == "| one    |  0.0123 |"
    assert TABLE.to_csv() == "name,a [m]\none,0.0123456\nlonger,7\n"


def test_what_there_is_not_is_a_dash() -> None:
    table = new_table(("a", "b", "c"), [("x", np.nan, None), ("y", 1.0, 3)])
    assert "| x   |    - |   - |" in markdown(table)
    assert text(new_table(("a", "b"), [])).splitlines()[0].split() == ["a", "b"]


def test_special_characters_are_escaped() -> None:
    table = new_table(("a_1 [%]", "b"), [("x & y_z <b>", 1.0)])
    assert r"a\_1 [\%] & b" in latex(table, "5 of all", "tab:all")
    assert r"x \& y\_z" in latex(table, "5 of all", "tab:all")
    assert "&lt;b&gt;" in html(table)
