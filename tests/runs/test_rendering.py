"""Pictures of a run: of the size asked for, of the whole scene, and plain words where something is missing."""

from __future__ import annotations

import dataclasses
import math
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from PIL import Image

from finite_strain.geometry.symmetry import ModelBall
from finite_strain.output.field_catalogue import outline
from linear_bem import Ball, Cone, Layer, Load, Problem, Punch
from linear_bem.errors import InvalidProblem, OutputUnusable
from linear_bem.indenter import HeightFunction
from runs.commands import render
from runs.commands.render import read_size, render_run
from runs.display.numbers import Scale
from runs.pictures import drawing
from runs.pictures.coloring import COLORINGS, prefixed, round_length
from runs.pictures.written_step import read_step, step_files
from tests.launch import python

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
"""Corners of a cube in VTK's order."""
ALONE = {"index": 0, "copies": 1, "fixed_axes": ()}


def write_run(folder: Path, steps: int = 2) -> Path:
    """Write the quarter of a pair's layer as a run does, dented by paraboloids in proportion to the step."""
    fields = folder / "fields"
    fields.mkdir(parents=True)
    sides, count = np.array([6e-3, 5e-3, 2e-3]), np.array([12, 10, 4])
    i = np.stack(np.meshgrid(*(np.arange(n) for n in count), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    nodes = (i + CORNERS) / count * sides - [0.0, 0.0, sides[2]]
    _, first, cells = np.unique(np.round(nodes.reshape(-1, 3) * 1e9), axis=0, return_index=True, return_inverse=True)
    points = nodes.reshape(-1, 3)[first]
    for number in range(1, steps + 1):
        approach = 0.4e-3 * number / steps
        depth = np.maximum(approach - ((points[:, 0] - 2e-3) ** 2 + points[:, 1] ** 2) / 4e-3, 0.0)
        fading = 1.0 + points[:, 2] / sides[2]
        u = np.zeros_like(points)
        u[:, 2] = -depth * fading
        with h5py.File(fields / f"step_{number:04d}.h5", "w") as file:
            file["points"], file["cells"] = points, cells.reshape(-1, 8)
            file["cell_fields/region"] = np.ones(len(nodes), dtype=np.int64)
            for name, values, unit in (("displacement", u, "m"), ("von_mises", 1e9 * depth * fading, "Pa")):
                file[f"node_fields/{name}"] = values
                file[f"node_fields/{name}"].attrs.update(unit=unit, kind=("Scalar", "Vector")[values.ndim - 1])
            file["cell_fields/region"].attrs["kind"] = "Scalar"
            file.attrs.update(
                deformed=True, layer_young=1e6, frame_origin=np.zeros(3), mirror_planes=np.eye(3)[:2],
                ball_positions=[[-2e-3, 0.0], [2e-3, 0.0]], ball_radii=[2e-3, 2e-3], ball_approaches=[approach] * 2,
                ball_shapes=["sphere", "sphere"],
            )  # fmt: skip
    return folder


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def drawn(run: Path) -> list[Path]:
    return render_run(run, size=(480, 300))


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"), dtype=float)


def test_pictures_have_the_size_asked_for_and_many_colours(drawn: list[Path], run: Path) -> None:
    assert [path.name for path in drawn[:2]] == ["von_mises_cut_step_0002.png", "von_mises_surface_step_0002.png"]
    assert all(path.parent == run / "pictures" for path in drawn)
    for path in drawn[:2]:
        picture = pixels(path)
        assert picture.shape == (300, 480, 3)
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 500
        assert (picture[0] == 255.0).all()  # a white margin
        drawing = picture[:240]
        assert 0.3 < np.mean((drawing < 250.0).any(axis=2)) < 0.95
        dark = (drawing.max(axis=2) < 130.0) & (drawing[..., 0] > 1.4 * drawing[..., 1])
        assert dark.any()  # the colour of the highest stress, not only foam and steel


def test_the_cut_shows_two_equal_dents(drawn: list[Path]) -> None:
    picture = pixels(drawn[0])[:240]
    hot = (picture[..., 0] > picture[..., 2] + 60.0) & (picture[..., 1] < 140.0)
    columns = np.flatnonzero(hot.any(axis=0))
    gaps = np.flatnonzero(np.diff(columns) > 20)
    assert len(gaps) == 1  # the mirror image is there: two spots apart
    left, right = columns[: gaps[0] + 1], columns[gaps[0] + 1 :]
    assert len(left) == pytest.approx(len(right), rel=0.15)


def test_the_animation_has_a_frame_for_every_step(drawn: list[Path]) -> None:
    animation = next(path for path in drawn if path.suffix == ".gif")
    with Image.open(animation) as film:
        assert film.size == (480, 300)
        assert film.n_frames == 2
        frames = []
        for number in range(2):
            film.seek(number)
            frames.append(np.asarray(film.convert("RGB"), dtype=float))
    assert np.abs(frames[1] - frames[0]).max() > 50.0


def test_a_written_part_is_completed_without_a_seam(run: Path) -> None:
    step = read_step(step_files(run)[2], 2, "von_mises")
    assert step.points.min(axis=0).tolist() == pytest.approx((-step.points.max(axis=0) - [0.0, 0.0, 2e-3]).tolist())
    corners = step.points[step.cells]
    volumes = np.linalg.det(corners[:, [1, 3, 4]] - corners[:, :1])  # of bricks
    assert volumes.min() > 0.0
    assert volumes.sum() == pytest.approx(4.0 * 6e-3 * 5e-3 * 2e-3)
    assert len(np.unique(np.round(step.points * 1e9), axis=0)) == len(step.points)
    assert step.thickness == pytest.approx(2e-3)


def test_colours_are_those_of_the_layer_and_units_those_of_the_tables(run: Path) -> None:
    step = read_step(step_files(run)[2], 2, "von_mises")
    below = step.points - [0.0, 0.0, 2e-3]
    stiffer = dataclasses.replace(
        step, points=np.concatenate([step.points, below]),
        cells=np.concatenate([step.cells, step.cells + len(below)]), region=np.repeat([1, 2], len(step.cells)),
        fields={"von_mises": np.concatenate([step.fields["von_mises"], np.full(len(below), 1e12)])},
    )  # fmt: skip
    limits = render._Shown(step, "von_mises").limits
    assert render._Shown(stiffer, "von_mises").limits == limits
    unlike = tuple(drawing.DrawnBall((x, 0.0), radius, 0.1, "sphere") for x, radius in ((-1.0, 1.0), (1.0, 0.5)))
    problem = Problem(Layer(1.0, 0.48, 1.16), tuple(Ball(b.position, b.radius) for b in unlike), Load("force", (1, 1)))
    assert dataclasses.replace(step, balls=unlike, young=1.0).dimensionless == Scale.of(problem).dimensionless
    assert not step.dimensionless


def test_a_paraboloid_is_a_solid_body() -> None:
    body = drawing._ball(drawing.DrawnBall((1e-3, 0.0), 2e-3, 0.5e-3, "paraboloid"))
    assert body.clean().is_manifold  # closed: no bowl to look into
    # the paraboloid's pi R^3 / 4 below its rim and the cylinder of half the radius above it
    assert body.volume == pytest.approx(math.pi * 2e-3**3 * (0.25 + 0.5), rel=2e-3)
    assert body.bounds[4] == pytest.approx(-0.5e-3)
    assert body.bounds[5] == pytest.approx(1.5e-3)


def test_a_body_that_is_no_ball_is_drawn_as_it_is(run: Path, tmp_path: Path) -> None:
    cone = Cone(slope=math.atan(0.5), tip_radius=1e-9)  # twice as wide as high
    points = outline(ModelBall((0.0, 0.0), 1e-9, cone, **ALONE, reach=2e-3))
    shutil.copytree(run, tmp_path / "run")
    file = step_files(tmp_path / "run")[2]
    with h5py.File(file, "r+") as written:
        written["ball_outlines"] = [points, np.full_like(points, np.nan)]
    drawn, sphere = read_step(file, 2, "von_mises").balls
    assert sphere.outline is None
    assert drawn.extent == pytest.approx(2e-3, rel=1e-3)
    body = drawing._ball(drawn)
    assert body.clean().is_manifold
    # a cone of half the height, and a cylinder above it; 96 directions leave 0.1 % of a circle
    assert body.volume == pytest.approx(math.pi * 2e-3**3 * (1.0 / 6.0 + 0.5), rel=2e-3)
    assert body.bounds[4] == pytest.approx(-drawn.approach)
    punch = outline(ModelBall((0.0, 0.0), 1e-3, Punch(1e-3, 1e-4), **ALONE, reach=1e-3))
    assert punch[..., 2].max() == pytest.approx(1e-4, rel=1e-3)
    assert np.isnan(outline(ModelBall((0.0, 0.0), 1.0, **ALONE))).all()


def test_a_long_body_without_an_edge_is_drawn_to_its_reach_and_not_to_the_sky() -> None:
    long = HeightFunction(0.25, lambda x, y: (x / 4.0) ** 8 + 2.0 * y**2)
    length, width, height = np.ptp(outline(ModelBall((0.0, 0.0), 0.25, long, **ALONE, reach=3.0)), axis=(0, 1))
    assert length == pytest.approx(6.0, rel=0.01)
    assert width == pytest.approx(2.0 * math.sqrt(0.5 * height))
    assert 0.1 < height < 0.13  # 18 m three metres beside the axis
    level = HeightFunction(1.0, lambda x, y: np.minimum(0.5 * (x**2 + y**2), 0.3))  # flat at its reach
    points = outline(ModelBall((0.0, 0.0), 1.0, level, **ALONE, reach=2.0))
    assert np.ptp(points[..., 0]) == pytest.approx(4.0, rel=1e-3)


def test_what_cannot_be_drawn_is_refused_in_plain_words(run: Path, tmp_path: Path) -> None:
    with pytest.raises(InvalidProblem, match=r"--step 7: .* holds steps 1, 2"):
        render_run(run, step=7)
    with pytest.raises(InvalidProblem) as caught:
        render_run(run, field="mises", views=("below",), size=(10, 300))
    assert len(caught.value.faults) == 3
    with pytest.raises(InvalidProblem, match="width x height"):
        read_size("large")
    with pytest.raises(OutputUnusable, match=r"holds no field pressure .there are displacement, von_mises"):
        render_run(run, field="pressure")
    shutil.copytree(run, tmp_path / "flat")
    for file in (tmp_path / "flat").rglob("*.h5"):
        with h5py.File(file, "r+") as opened:
            del opened["node_fields/displacement"]
    with pytest.raises(OutputUnusable, match=r"holds no field displacement .*; every picture needs it: add it to"):
        render_run(tmp_path / "flat")
    with pytest.raises(OutputUnusable, match="holds no written fields"):
        render_run(tmp_path)


def test_a_missing_pyvista_is_named_with_the_command_that_mends_it(run: Path, tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.util\n"
        "find = importlib.util.find_spec\n"
        "importlib.util.find_spec = lambda name, *rest: None if name == 'pyvista' else find(name, *rest)\n",
        encoding="utf-8",
    )
    done = python("-m", "runs.cli", "render", run, "--out", tmp_path / "out", env={"PYTHONPATH": str(tmp_path)})
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "render needs pyvista" in done.stderr
    assert "bash runs/setup.sh render" in done.stderr
    assert not (tmp_path / "out").exists()


def test_the_command_draws_what_its_options_name(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "pictures"
    options = ("--field", "displacement", "--view", "surface", "--view", "surface", "--step", "1", "--size", "320x200")
    done = python("-m", "runs.cli", "render", run, "--out", out, "--no-animation", *options)
    assert done.returncode == 0, done.stderr
    assert [path.name for path in out.iterdir()] == ["displacement_surface_step_0001.png"]
    assert pixels(out / "displacement_surface_step_0001.png").shape == (200, 320, 3)
    assert done.stderr.strip() == f"drawn: {out / 'displacement_surface_step_0001.png'}"  # VTK complains of nothing


def test_a_film_is_made_only_where_ffmpeg_is(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = [np.full((201, 301, 3), shade, dtype=np.uint8) for shade in (0, 255)]
    monkeypatch.setenv("PATH", str(tmp_path))
    assert not render.sheet.save_mp4(frames, tmp_path / "film.mp4")
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor last; do :; done\n/bin/cat > "$last"\n', encoding="utf-8")
    program.chmod(0o755)
    assert render.sheet.save_mp4(frames, tmp_path / "film.mp4")
    raw = (tmp_path / "film.mp4").read_bytes()
    assert len(raw) % (200 * 300 * 3) == 0  # an even width and height, as films need
    program.write_text("#!/bin/sh\necho no codec >&2\nexit 1\n", encoding="utf-8")
    with pytest.raises(OutputUnusable, match="no codec"):
        render.sheet.save_mp4(frames, tmp_path / "film.mp4")


@pytest.mark.parametrize(
    ("unit", "largest", "dimensionless", "expected"),
    [
        ("Pa", 2.5e5, False, (1e-3, "kPa")), ("Pa", 1e6, False, (1e-6, "MPa")), ("m", 2e-3, False, (1e3, "mm")),
        ("1", 1.2, False, (1.0, "")), ("Pa", 0.2, True, (1.0, "E")), ("m", 0.2, True, (1.0, "R")),
    ],
)  # fmt: skip
def test_units_get_the_prefix_that_suits(
    unit: str, largest: float, dimensionless: bool, expected: tuple[float, str]
) -> None:
    factor, name = prefixed(unit, largest, dimensionless)
    assert (pytest.approx(factor), name) == expected


def test_scale_bars_have_round_lengths() -> None:
    assert [round_length(x) for x in (0.00099, 0.001, 0.0049, 0.05, 7.0)] == pytest.approx(
        [5e-4, 1e-3, 2e-3, 0.05, 5.0]
    )


def test_every_written_field_can_be_drawn() -> None:
    from finite_strain.output.field_catalogue import CATALOGUE  # noqa: PLC0415

    shapes = {"Scalar": (), "Vector": (3,), "Tensor": (3, 3)}
    assert set(COLORINGS) == set(CATALOGUE)
    for name, field in CATALOGUE.items():
        values = np.random.default_rng(2).random((5, *shapes[field.kind]))
        numbers = COLORINGS[name].number(values)
        assert numbers.shape == (5,)
        low, high = COLORINGS[name].limits(numbers)
        assert low < high
        assert math.isfinite(high - low)
        COLORINGS[name].color_map()
