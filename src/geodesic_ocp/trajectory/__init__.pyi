from .bundled_recording import bundled_recording as bundled_recording
from .files.angle_tables import Column as Column
from .files.angle_tables import save_motion as save_motion
from .joint_trajectory import JointTrajectory as JointTrajectory
from .motion import Subject as Subject
from .recording import Recording as Recording
from .time_law import TimeLaw as TimeLaw
from .time_law import time_law as time_law
