from .comparison_figure import draw_curves as draw_curves
from .live_plot import LivePlot as LivePlot
from .study_figures import study_figures as study_figures
from .styles import in_degrees as in_degrees
from .viewer import Viewer as Viewer
from .viewer import report as report
