from .arm_shapes import draw_obstacle as draw_obstacle
from .viewer import Viewer as Viewer
from .viewer import report as report
