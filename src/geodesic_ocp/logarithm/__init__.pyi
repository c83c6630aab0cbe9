from .geodesic import Geodesic as Geodesic
from .geodesic import geodesic_from_velocity as geodesic_from_velocity
from .geodesic_to_pose import geodesic_to_pose as geodesic_to_pose
from .riemannian_spline import MotionCertificate as MotionCertificate
from .riemannian_spline import RiemannianSpline as RiemannianSpline
