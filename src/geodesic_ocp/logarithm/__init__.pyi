from .cubics import MotionCertificate as MotionCertificate
from .cubics import RiemannianSpline as RiemannianSpline
from .geodesic_to_pose import ToPose as ToPose
