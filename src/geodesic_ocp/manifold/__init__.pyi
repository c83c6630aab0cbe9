from .connection import riemann_curvature as riemann_curvature
from .connection import scalar_curvature as scalar_curvature
from .connection import sectional_curvature as sectional_curvature
from .metrics import AdjustableKineticEnergy as AdjustableKineticEnergy
from .metrics import JacobiMetric as JacobiMetric
from .metrics import default_joint_inertia as default_joint_inertia
from .region_avoiding import RegionAvoiding as RegionAvoiding
