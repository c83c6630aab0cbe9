"""Tables as text, Markdown and CSV."""

from __future__ import annotations

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
