from .arm_shapes import draw_obstacle as draw_obstacle
from .report import report as report
from .viewer import Viewer as Viewer
