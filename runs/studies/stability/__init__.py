"""The study ``stability``: hard cases times models, each with a right answer and its check, or a named refusal."""

from runs.studies.framework.records import ENDED
from runs.studies.framework.runner import study_of_cases
from runs.studies.stability.answer import present
from runs.studies.stability.matrix import cases

STUDY = study_of_cases("stability", cases, present, answers=ENDED)
