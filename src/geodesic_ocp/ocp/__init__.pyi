from .callback import Iterate as Iterate
from .certificate import Certificate as Certificate
from .motion_problem import MotionSolution as MotionSolution
from .nlp import NLP as NLP
from .solution import Stats as Stats
