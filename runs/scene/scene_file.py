"""A scene file: TOML tables of layer, balls, load and the effects to be simulated, checked as a whole."""

import difflib
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError, create_model

from linear_bem.depth import depth_faults
from linear_bem.errors import InvalidProblem, UnsupportedProblem
from linear_bem.magnitudes import SIZES
from linear_bem.problem import Ball, Elements, Layer, Load, Problem
from runs.scene import messages
from runs.scene.balls import BallsTable, per_ball
from runs.scene.effects import EFFECTS, Effect
from runs.scene.effects.reciprocation import ReciprocationTable
from runs.scene.load_table import LoadTable
from runs.scene.unit_doubts import SOFT, unit_notes
from runs.scene.units import Length, Number, Pressure, Table, Units, Whole

SOFTEST = 100.0
"""Young's modulus [Pa] of a layer below which the user may have forgotten its unit."""
CAUSE = "a possible cause: "


class InvalidScene(InvalidProblem):
    """A scene file that cannot be solved as written; ``faults`` holds one text per fault."""

    def __init__(self, path: Path, *texts: str) -> None:
        super().__init__(*texts)
        self.path = path

    def __str__(self) -> str:
        if len(self.faults) == 1:
            return f"{self.path}: {self.faults[0]}"
        count = sum(not text.startswith(CAUSE) for text in self.faults)
        heading = f"{self.path}: {count} fault{'' if count == 1 else 's'}"
        return "\n".join([heading, *(f"  {text}" for text in self.faults)])


class LayerTable(Table):
    """[layer]: elastic constants and thickness."""

    young: Pressure
    """Young's modulus; at finite strain, the initial modulus."""
    poisson: Number
    """Poisson's ratio, 0 to 0.5; 0.5 is incompressible."""
    thickness: Length
    """Thickness of the undeformed layer; `inf` for a half-space."""


class ElementsTable(Table):
    """[elements]: formulation of the finite elements; without this table, Poisson's ratio decides."""

    form: Literal["displacement", "mixed"]
    """Unknowns: displacement only, or displacement and pressure (`mixed`; without this table, from nu = 0.49 on)."""


class OutputTable(Table):
    """[output]: fields that a finite-element run writes, and how often; without this table, all at every load step."""

    fields: tuple[str, ...] | None = None
    """Names of the fields; `thirdbody solve` lists them if one is misspelt."""
    every: Whole = 1
    """Write at every n-th load step; the last step is always written."""

    def faults(self) -> list[str]:
        """Return what is out of range, one text each."""
        from finite_strain.output.field_catalogue import choice_faults  # noqa: PLC0415  (only where a scene has the table)

        return choice_faults(self.fields or (), self.every)


class AccuracyTable(Table):
    """[accuracy]: required relative accuracy of the tangential force T, and limits for models that refine their mesh.

    Without a key, the model's own default applies.
    """

    tangential_force: Number | None = None
    """Largest permitted relative error of T; for finite elements at least 1e-4.

    A single ball has no T: finite elements then refine its normal force, or its approach under a given force.
    """
    seconds: Number | None = None
    """Wall time of the run [s] beyond which no finer mesh is started.

    A mesh that has started is finished, and the first two always run.
    """
    unknowns: Number | None = None
    """Largest number of unknowns of the finest mesh."""

    @property
    def budget(self) -> dict[str, float]:
        """The limits that the scene states."""
        return {k: v for k in ("seconds", "unknowns") if (v := getattr(self, k)) is not None}


class PlainTables(Table):
    """Every table that a scene may hold besides those of its effects."""

    title: str = ""
    layer: LayerTable
    balls: BallsTable
    load: LoadTable
    accuracy: AccuracyTable = AccuracyTable()
    elements: ElementsTable | None = None
    output: OutputTable | None = None

    def effects(self) -> list[tuple[Effect, Any]]:
        """Return the effects whose tables the scene has, with these tables."""
        found = [(effect, getattr(self, name)) for name, effect in EFFECTS.items()]
        return [(effect, table) for effect, table in found if table is not None]

    def drift(self) -> dict[str, Any]:
        """Return the tables of the effects on the motion of the balls, keyed by name; empty if balls do not move."""
        found = {effect.name: table for effect, table in self.effects() if effect.of_drift}
        return found if "reciprocation" in found else {}

    def _small_balls(self) -> tuple[Ball, ...]:
        """Return stand-ins for faulty balls: too small to overlap, large enough for every load that a ball may have."""
        lengths = [self.layer.thickness, *(abs(float(c)) for place in self.balls.positions for c in place)]
        kind, values = self.load.given
        if kind == "approach":
            lengths += map(abs, values if isinstance(values, tuple) else (values,))
        radius = 1e-7 * max((length for length in lengths if 0.0 < length <= SIZES[1]), default=0.0) or 1.0
        return tuple(Ball(place, radius) for place in self.balls.positions)

    def problem(self) -> Problem:
        """Return the contact problem; raises `InvalidProblem` with every fault found."""
        size = len(self.balls.positions)
        texts: list[str] = []
        try:
            balls = self.balls.balls()
        except InvalidProblem as error:
            texts += error.faults
            balls = self._small_balls()
        accuracy = self.accuracy.tangential_force
        if accuracy is not None and not 0.0 < accuracy < 1.0:
            texts.append(f"accuracy.tangential_force: must be above 0 and below 1 (2 % is 0.02), got {accuracy:g}")
        texts += [
            f"accuracy.{key}: must be greater than 0, got {value:g}"
            for key, value in self.accuracy.budget.items()
            if not value > 0.0
        ]
        if self.output is not None:
            texts += self.output.faults()
        kind, values = self.load.given
        try:
            self.load.fractions()
        except InvalidProblem as error:
            texts += error.faults
        parts, drifts = {}, self.drift()
        for effect, table in self.effects():
            texts += effect.faults(table, self)
            if effect.part is not None and effect.name not in drifts:  # pair forces are those of two balls alone
                parts[effect.name] = effect.part(table)
        try:
            problem = Problem(
                Layer(self.layer.young, self.layer.poisson, self.layer.thickness),
                balls,
                Load(kind, per_ball(values, 1 if kind == "total_force" else size)),
                elements=Elements(self.elements.form) if self.elements else None,
                **parts,
            )
        except InvalidProblem as error:
            raise InvalidProblem(*texts, *error.faults) from None
        texts = texts or depth_faults(problem)
        if texts:
            raise InvalidProblem(*texts)
        return problem


_optional: dict[str, Any] = {name: (effect.table | None, None) for name, effect in EFFECTS.items()}
Tables = create_model("Tables", __base__=PlainTables, **_optional)
"""Every table that a scene may hold."""


@dataclass(frozen=True)
class Scene:
    """A valid scene: the file, its text and data as written, and the problem that they describe.

    ``drift`` holds the tables of the effects on the motion of the balls, keyed by name.
    """

    path: Path
    text: str
    data: dict[str, Any]
    title: str
    problem: Problem
    effects: tuple[str, ...]
    tangential_force: float | None
    drift: dict[str, Any] = field(default_factory=dict)
    output: OutputTable | None = None
    budget: dict[str, float] = field(default_factory=dict)
    steps: tuple[float, ...] | None = None
    """Load fractions with output; None: the default of the command."""

    @property
    def reciprocation(self) -> ReciprocationTable | None:
        """The sliding that moves the balls; None: they stay where they are."""
        return self.drift.get("reciprocation")

    @property
    def sliding(self) -> ReciprocationTable:
        """The same, of a scene whose balls drift."""
        sliding: ReciprocationTable = self.drift["reciprocation"]
        return sliding

    @property
    def doubts(self) -> tuple[str, ...]:
        """Notes where units may be missing: beside lengths with units, those without, and a very small modulus."""
        young = self.problem.layer.young
        soft = f"[layer] young: {young:g} Pa {SOFT}; did you mean kPa or MPa?"
        is_soft = young < SOFTEST and Units.written(self.data) is not None
        return (*((soft,) if is_soft else ()), *unit_notes(self.data))

    @contextmanager
    def naming_faults(self) -> Iterator[None]:
        """Name the file and its keys in an `InvalidProblem` or `UnsupportedProblem` that a model or a drift raises."""
        try:
            yield
        except InvalidScene:
            raise
        except InvalidProblem as error:
            raise InvalidScene(self.path, *(messages.of_problem(text, self.data) for text in error.faults)) from None
        except UnsupportedProblem as error:
            if str(error).startswith(f"{self.path}:"):
                raise
            texts = (messages.of_problem(text, self.data) for text in str(error).splitlines())
            raise UnsupportedProblem("\n".join(f"{self.path}: {text}" for text in texts)) from None


def read_scene(path: Path) -> Scene:
    """Return the scene in ``path``; raises `InvalidScene` with all its faults at once."""
    text = _read_text(path)
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InvalidScene(path, messages.of_toml(str(error), text)) from None
    tables, texts, doubtful = _validate(data)
    problem = None
    if tables is not None:
        try:
            problem = tables.problem()
        except InvalidProblem as error:
            texts += [messages.of_problem(t, data) for t in error.faults if not messages.concerns(t, doubtful)]
            if not doubtful and any(word in text for text in error.faults for word in ("overlap", "thickness", "deep")):
                texts += [f"{CAUSE}{note}" for note in unit_notes(data)]
    if texts or tables is None or problem is None:
        raise InvalidScene(path, *dict.fromkeys(texts))
    effects = [effect.name for effect, _ in tables.effects()]
    title = "".join(c if c.isprintable() else " " for c in tables.title or path.stem)  # escapes command a terminal
    accuracy = tables.accuracy.tangential_force
    return Scene(
        path, text, data, title, problem, tuple(effects), accuracy, tables.drift(), tables.output,
        tables.accuracy.budget, tables.load.fractions(),
    )  # fmt: skip


def _validate(data: dict[str, Any]) -> tuple[PlainTables | None, list[str], set[str]]:
    """Return the tables, the faults of their keys, and the keys that are stand-ins for faulty ones.

    A faulty key is replaced by a harmless value, so that the other keys are still checked.
    """
    texts, doubtful = list[str](), set[str]()
    for _ in range(3):  # a table is checked as a whole once its keys are valid
        try:
            return Tables.model_validate(data), texts, doubtful
        except ValidationError as error:
            errors = error.errors()
        texts += [messages.of_key(e, Tables) for e in errors]
        data, replaced = messages.stand_in(errors, data)
        doubtful |= replaced
    return None, texts, doubtful


def _read_text(path: Path) -> str:
    try:
        if path.is_dir():
            raise InvalidScene(path, "is a folder, not a scene file: name a .toml file in it")
        if not path.exists():
            raise InvalidScene(path, f"does not exist{_similar_files(path)}")
        if not path.is_file():
            raise InvalidScene(path, "is not a regular file: name a .toml file")
        return path.read_text(encoding="utf-8-sig")  # editors may put a byte order mark
    except UnicodeDecodeError as error:
        raise InvalidScene(path, f"is not TOML, which is UTF-8 text: {error.reason} at byte {error.start}") from None
    except (OSError, ValueError) as error:
        if isinstance(error, InvalidScene):
            raise
        raise InvalidScene(path, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None


def _similar_files(path: Path) -> str:
    try:
        if path.with_name(f"{path.name}.toml").exists():
            return f"; did you mean {path}.toml?"
        names = [p.name for p in path.parent.glob("*.toml")]
    except OSError:
        return ""
    close = difflib.get_close_matches(path.name, names, n=1, cutoff=0.75)
    return f"; did you mean {path.parent / close[0]}?" if close else ""
