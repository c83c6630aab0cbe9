from .geodesic_to_pose import ToPose as ToPose
