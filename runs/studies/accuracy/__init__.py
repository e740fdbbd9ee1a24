"""The study ``accuracy``: error of T against processor time, over models and over every knob of the solvers."""

from runs.studies.accuracy.answer import present
from runs.studies.accuracy.matrix import cases
from runs.studies.framework.runner import study_of_cases

STUDY = study_of_cases("accuracy", cases, present, ("pareto.svg", "pareto.png"))
