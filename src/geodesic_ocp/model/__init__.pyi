from . import distances as distances
from .combine import combine as combine
from .inertias import robot_armature as robot_armature
from .inertias import with_rotor_inertia as with_rotor_inertia
