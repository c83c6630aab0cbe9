from .obstacles import draw_obstacle as draw_obstacle
