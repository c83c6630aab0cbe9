"""Text, numbers and units in LaTeX."""

from __future__ import annotations

import re

_UNIT = r"(?:m?rad|deg|mm|m|cm|kg|g|ms|s|min|h|J|N|W|Hz|1)"
_POWER = rf"(?:{_UNIT}|sqrt\({_UNIT}\))(?:\^-?\d+(?:/\d+)?)?"
_UNITS = re.compile(rf"{_POWER}(?:[ /]{_POWER})*|%")
# Numbers with a minus sign or an exponent, which text mode would set as a hyphen and letters.
_NUMBERS = re.compile(
    r"(?<![\w.+-])(?P<sign>-?)(?P<digits>\d+(?:\.\d*)?)(?:e(?P<exponent>[+-]\d+))?(?!\w|\.\d)"
)
_WHOLE = {"-": "--", "nan": "--", "inf": r"$\infty$", "-inf": r"$-\infty$"}
_SYMBOLS = {
    "<": "<",
    ">": ">",
    "|": "|",
    "±": r"\pm",
    "\N{MINUS SIGN}": "-",
    "\N{MULTIPLICATION SIGN}": r"\times",
    "·": r"\cdot",
    "≤": r"\le",
    "≥": r"\ge",
    "≈": r"\approx",
    "°": r"^\circ",
    "²": "^2",
    "³": "^3",
    "∞": r"\infty",
    "µ": r"\mu",
}
_ESCAPED = {
    **{character: f"\\{character}" for character in "{}$&#%_"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "`": r"\textasciigrave{}",
    '"': "''",
    **{character: f"${command}$" for character, command in _SYMBOLS.items()},
}


def latex_text(text: str) -> str:
    """Text in which no character is a command, with its numbers typeset; `nan` is a dash."""
    if text in _WHOLE:
        return _WHOLE[text]
    pieces, end = [], 0
    for found in _NUMBERS.finditer(text):
        pieces += [_escaped(text[end : found.start()]), _number(found)]
        end = found.end()
    return "".join([*pieces, _escaped(text[end:])])


def latex_header(text: str) -> str:
    """Text with its units, in brackets at the end, typeset in mathematics."""
    found = re.fullmatch(r"(.*)\[([^\[\]]+)\]", text)
    units = re.split(r"(, | or )", found[2]) if found else []
    if found is None or not all(_UNITS.fullmatch(unit) for unit in units[::2]):
        return latex_text(text)
    inner = "".join(part if k % 2 else _unit(part) for k, part in enumerate(units))
    return f"{latex_text(found[1])}[{inner}]"


def latex_note(note: str) -> str:
    """Text in which `names` are set in typewriter letters, as Markdown does."""
    parts = note.split("`")
    if len(parts) % 2 == 0:
        return latex_text(note)
    texts = [latex_text(part) for part in parts]
    return "".join(rf"\texttt{{{each}}}" if k % 2 else each for k, each in enumerate(texts))


def _unit(unit: str) -> str:
    """A unit such as m^2, kg^1/2 m or sqrt(kg) m."""
    if unit in ("1", "%"):
        return unit.replace("%", r"\%")
    unit = re.sub(r"\^(-?\d+(?:/\d+)?)", r"^{\1}", unit)
    unit = re.sub(r"sqrt\((\w+)\)", r"\\sqrt{\1}", unit).replace(" ", r"\,")
    return rf"$\mathrm{{{unit}}}$"


def _number(found: re.Match[str]) -> str:
    if found["exponent"]:
        return rf"${found['sign']}{found['digits']}\times 10^{{{int(found['exponent'])}}}$"
    return f"${found[0]}$" if found["sign"] else found[0]


def _escaped(text: str) -> str:
    printed = (character if character.isprintable() else " " for character in text)
    return "".join(_ESCAPED.get(character, character) for character in printed)
