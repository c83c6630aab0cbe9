"""Names as text that pages, pictures and files can hold."""

import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from geodesic_ocp.drawing.scene import plain_text

ANY = st.text(st.characters(exclude_categories=()))


def test_ordinary_names_stay_as_they_are() -> None:
    assert plain_text("Jürgen's arm, 日本 <b> 🤖 q̇") == "Jürgen's arm, 日本 <b> 🤖 q̇"


def test_controls_line_breaks_and_directions_become_spaces() -> None:
    assert plain_text("a\0b\nc\u202ed\u2028e\x1b") == "a b c d e "


def test_bytes_that_are_no_text_are_marked() -> None:
    assert plain_text(b"caf\xe9".decode("utf-8", "surrogateescape")) == "caf\ufffd"


@given(ANY)
def test_whatever_the_name_it_can_be_written_and_is_on_one_line(text: str) -> None:
    plain = plain_text(text)
    plain.encode()
    assert len(plain) == len(text)
    assert not any(unicodedata.category(each) in {"Cc", "Cf", "Cs", "Zl", "Zp"} for each in plain)
    assert plain_text(plain) == plain
