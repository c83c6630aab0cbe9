"""The accidents that happen to files."""

from __future__ import annotations

from hypothesis import strategies as st

NUMBERS = (b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"1e-320", b"0", b"-1", b"65536", b"")
NUMBERS += (
    b"9" * 400,
    b"99999999999999999999",
    b"1e9",
    b"x",
    b"\xe4",
    b"\0",
    b"0x10",
    b"1,5",
    b"1 2",
    b"\xff",
)


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """The content after one to three of the accidents that happen to files."""
    for _ in range(draw(st.integers(1, 3))):
        if not content:
            break
        accident = draw(st.sampled_from(ACCIDENTS))
        content = accident(draw, content)
    return content


def place(draw: st.DrawFn, content: bytes) -> int:
    return draw(st.integers(0, max(len(content) - 1, 0)))


def truncated(draw: st.DrawFn, content: bytes) -> bytes:
    return content[: place(draw, content)]


def replaced_byte(draw: st.DrawFn, content: bytes) -> bytes:
    at = place(draw, content)
    return content[:at] + bytes([draw(st.integers(0, 255))]) + content[at + 1 :]


def swapped_bytes(draw: st.DrawFn, content: bytes) -> bytes:
    first, second = sorted([place(draw, content), place(draw, content)])
    changed = bytearray(content)
    changed[first], changed[second] = content[second], content[first]
    return bytes(changed)


def deleted_bytes(draw: st.DrawFn, content: bytes) -> bytes:
    at = place(draw, content)
    return content[:at] + content[at + draw(st.integers(1, 600)) :]


def repeated_bytes(draw: st.DrawFn, content: bytes) -> bytes:
    at = place(draw, content)
    end = at + draw(st.integers(1, 600))
    return content[:end] + content[at:]


def inserted_bytes(draw: st.DrawFn, content: bytes) -> bytes:
    at = place(draw, content)
    new = draw(st.sampled_from([b"\0", b"\xe4", b"\n", b'"', b"<", b"\xff\xff", b";"]))
    return content[:at] + new + content[at:]


def changed_lines(draw: st.DrawFn, content: bytes) -> bytes:
    """A line deleted, repeated, or exchanged with another."""
    lines = content.split(b"\n")
    first, second = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
    kind = draw(st.sampled_from(["delete", "repeat", "exchange"]))
    if kind == "delete":
        del lines[first]
    elif kind == "repeat":
        lines.insert(second, lines[first])
    else:
        lines[first], lines[second] = lines[second], lines[first]
    return b"\n".join(lines)


def changed_number(draw: st.DrawFn, content: bytes) -> bytes:
    """A word between blanks, commas, brackets or signs of equality, of which most are numbers."""
    ends = [i for i, byte in enumerate(content) if byte in b" \t\n,=<>'\""]
    if len(ends) < 2:
        return content
    index = draw(st.integers(0, len(ends) - 2))
    new = draw(st.sampled_from(NUMBERS))
    return content[: ends[index] + 1] + new + content[ends[index + 1] :]


def changed_words(draw: st.DrawFn, content: bytes) -> bytes:
    """Four bytes that are a large number, not finite, negative or zero in a binary file."""
    at = place(draw, content)
    words = ["ffffffff", "7f800000", "0000807f", "0000c07f", "00000000", "ff7fff7f", "ffff7f7f"]
    return content[:at] + bytes.fromhex(draw(st.sampled_from(words))) + content[at + 4 :]


def deleted_tag(draw: st.DrawFn, content: bytes) -> bytes:
    """A tag of XML."""
    start = content.find(b"<", place(draw, content))
    return content if start < 0 else content[:start] + content[content.find(b">", start) + 1 :]


ACCIDENTS = [
    truncated,
    replaced_byte,
    swapped_bytes,
    deleted_bytes,
    repeated_bytes,
    inserted_bytes,
    changed_lines,
    changed_number,
    changed_number,
    changed_words,
    deleted_tag,
]
