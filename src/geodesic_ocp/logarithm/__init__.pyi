from .geodesic import geodesic_from_velocity as geodesic_from_velocity
from .geodesic_to_pose import ToPose as ToPose
from .riemannian_spline import MotionCertificate as MotionCertificate
from .riemannian_spline import RiemannianSpline as RiemannianSpline
