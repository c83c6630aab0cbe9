from .certificate import Certificate as Certificate
from .certificate import certify as certify
from .inverse_kinematics import inverse_kinematics as inverse_kinematics
from .load_solution import load_solution as load_solution
from .motion_problem import MotionSolution as MotionSolution
from .nlp import NLP as NLP
from .solution import Solution as Solution
from .solution import Stats as Stats
