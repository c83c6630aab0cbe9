from .report import report as report
from .viewer import Viewer as Viewer
