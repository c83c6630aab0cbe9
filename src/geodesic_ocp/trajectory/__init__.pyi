from .filters import MotionFilter as MotionFilter
from .motion import FrameMotion as FrameMotion
from .motion import Subject as Subject
from .outliers import Outlier as Outlier
from .time_law import TimeLaw as TimeLaw
from .time_law import time_law as time_law
