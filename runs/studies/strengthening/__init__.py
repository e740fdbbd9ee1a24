"""The study ``strengthening``: T of finite over small strain, at equal force and approach, and what causes it."""

from runs.studies.framework.runner import study_of_cases
from runs.studies.strengthening.answer import present
from runs.studies.strengthening.matrix import cases

PICTURES = tuple(f"{name}.{kind}" for name in ("strengthening", "parameters") for kind in ("svg", "png"))
STUDY = study_of_cases("strengthening", cases, present, PICTURES)
