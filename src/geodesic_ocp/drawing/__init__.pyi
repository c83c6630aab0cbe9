from .arm_shapes import draw_obstacle as draw_obstacle
from .styles import in_degrees as in_degrees
from .viewer import Viewer as Viewer
from .viewer import report as report
