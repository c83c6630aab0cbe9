"""Units in which files give angles and positions."""

from __future__ import annotations

import numpy as np

#: Radians in a unit of angle, by its name in lower case.
ANGLES = {
    **dict.fromkeys(("rad", "rads", "radian", "radians"), 1.0),
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "°"), np.pi / 180.0),
}
#: Metres in a unit of length, by its name in lower case.
LENGTHS = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 1e-2),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 1e-3),
}
