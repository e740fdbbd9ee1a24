"""The study ``verification``: the finite-strain model against closed forms, published results, and itself."""

from runs.studies.framework.records import ENDED
from runs.studies.framework.runner import study_of_cases
from runs.studies.verification.answer import cases, present

STUDY = study_of_cases("verification", cases, present, ("verification.svg", "verification.png"), ENDED)
