"""Weights of a trajectory's objective, beside the time beyond the person's.

The objective counts time as a fraction of the person's; distances, accelerations and jerks are
squared and integrated over the trajectory's time.
"""

DISTANCE = 0.1  # from the paths [rad] that costs, if kept up, as much as the time it is kept up
UNEVEN = 0.05  # of the squared stretch of an interval
SHORT = 0.2  # intervals shorter than this [s] may be stretched more
ACCELERATION = 2e-3  # at the limit
JERK, JERK_TIME = 1e-3, 0.05  # when an acceleration changes by its limit in this time [s]
END_SPEED = 0.1  # of differences from the intended speeds at the ends, relative to the limits
