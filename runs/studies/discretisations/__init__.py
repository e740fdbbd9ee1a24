"""The study ``discretisations``: work against precision of the elements' order and size, on five unlike scenes."""

from runs.studies.discretisations.answer import present
from runs.studies.discretisations.matrix import cases
from runs.studies.framework.runner import study_of_cases

STUDY = study_of_cases("discretisations", cases, present)
