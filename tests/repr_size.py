"""How long `repr` of a value is at most."""

LINES = 3
CHARACTERS = 300
