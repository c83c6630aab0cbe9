from . import distances as distances
from .combine import combine as combine
from .inertias import RobotArmature as RobotArmature
from .inertias import robot_armature as robot_armature
from .inertias import with_rotor_inertia as with_rotor_inertia
from .link_geometry import enclosing_capsule as enclosing_capsule
