"""plain_text: names and titles as text that pages, pictures and files can hold."""

from __future__ import annotations

_UNKNOWN = "\N{REPLACEMENT CHARACTER}"


def plain_text(text: str) -> str:
    """The text on one line, without what cannot be printed.

    Names of joints and files may contain anything. Control characters, NUL and line breaks among
    them, and characters that change the direction of writing become spaces; bytes that are no UTF-8
    (lone surrogates, as Python reads such names of files) become U+FFFD.
    """
    if text.isprintable():
        return text
    return "".join(
        each if each.isprintable() else _UNKNOWN if "\ud800" <= each <= "\udfff" else " "
        for each in text
    )
