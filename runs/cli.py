"""The command line ``thirdbody``: one function per command, which imports its modules only when it is called."""

import contextlib
import importlib.metadata
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from runs import studies
from runs.models import ModelName
from runs.process import ranks
from runs.scene.scene_file import Scene, read_scene
from runs.session.session import Options
from runs.session.terminal import waiting

app = typer.Typer(
    name="thirdbody",
    help="Mutual effects of rigid balls in soft contact: small strain against finite strain.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

SceneArgument = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).", show_default=False)]
JsonOption = Annotated[bool, typer.Option("--json", help="Print only the result's JSON on standard output.")]
OutOption = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Output folder; default out/SCENE-COMMAND-MODEL (out/SCENE-compare)."),
]
FreshOption = Annotated[bool, typer.Option("--fresh", help="Delete the files of an earlier run and start again.")]
TablesOption = Annotated[
    Path | None,
    typer.Option("--tables", metavar="DIR", help="Folder of a drift's tables of pairs; default out/pair-tables."),
]
ModelOption = Annotated[
    ModelName | None,
    typer.Option(
        "--model", help="Default: finite_strain if the scene has that table, else linear_bem.", show_default=False
    ),
]


@app.callback(invoke_without_command=True)
def top(version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False) -> None:
    """Mutual effects of rigid balls in soft contact: small strain against finite strain."""
    if version:
        print(f"thirdbody {importlib.metadata.version('thirdbody')}")
        raise typer.Exit


@contextlib.contextmanager
def read(file: Path) -> Iterator[Scene]:
    """Read a scene; errors found in it later name the file, too. Show the elapsed time if reading takes long."""
    with waiting(f"reading {file}") if ranks.is_root() else contextlib.nullcontext():
        scene = read_scene(file)
    with scene.naming_faults():
        yield scene


@app.command()
def solve(
    scene: SceneArgument,
    model: ModelOption = None,
    as_json: JsonOption = False,
    out: OutOption = None,
    fresh: FreshOption = False,
) -> None:
    """Solve a scene with one model. An unfinished run is resumed; the result of a finished run is shown again."""
    from runs.commands.solve import solve_scene  # noqa: PLC0415

    with read(scene) as given:
        solve_scene(given, model.value if model else None, Options(as_json, out, fresh))


@app.command()
def compare(
    scene: SceneArgument, as_json: JsonOption = False, out: OutOption = None, fresh: FreshOption = False
) -> None:
    """Compare the finite-strain load path with the linear model, at equal normal forces and at equal approaches."""
    from runs.commands.compare import compare_scene  # noqa: PLC0415

    with read(scene) as given:
        compare_scene(given, Options(as_json, out, fresh))


@app.command()
def evolve(
    scene: SceneArgument,
    model: ModelOption = None,
    as_json: JsonOption = False,
    out: OutOption = None,
    fresh: FreshOption = False,
    tables: TablesOption = None,
) -> None:
    """Let the balls of a scene drift under their mutual forces while the plate slides back and forth."""
    from runs.evolution.evolving import evolve_scene  # noqa: PLC0415

    with read(scene) as given:
        evolve_scene(given, model.value if model else None, Options(as_json, out, fresh), tables)


@app.command()
def plan(
    scene: SceneArgument,
    model: ModelOption = None,
    as_json: JsonOption = False,
    no_advice: Annotated[
        bool, typer.Option("--no-advice", help="Leave out the advice on effects and inputs that change T.")
    ] = False,
    tables: TablesOption = None,
) -> None:
    """Show which effects a scene simulates, its size, time and memory, and which changes of the scene matter."""
    from runs.commands.plan import plan_scene  # noqa: PLC0415

    with read(scene) as given:
        plan_scene(given, model.value if model else None, as_json=as_json, advises=not no_advice, pair_tables=tables)


@app.command()
def study(
    name: Annotated[str, typer.Argument(metavar="NAME", help=f"One of: {studies.listing()}.", show_default=False)],
    quick: Annotated[bool, typer.Option("--quick", help="Run a coarse version that takes seconds.")] = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Output folder; default out/study-NAME.")
    ] = None,
    fresh: FreshOption = False,
    shard: Annotated[str, typer.Option("--shard", metavar="i/n", help="Run only the i-th of n parts.")] = "1/1",
    tables: Annotated[
        bool, typer.Option("--tables", help="Compute nothing; write tables and figures from the saved parts.")
    ] = False,
    publish: Annotated[bool, typer.Option("--publish", help="Write the results into the study's README.")] = False,
) -> None:
    """Run a study and write its tables and figures. Parts that are already saved are not computed again."""
    options = studies.Options(quick, out, fresh, studies.read_shard(shard), tables, publish)
    studies.run_study(name, options)


@app.command()
def render(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Output folder of a finite-element run.")],
    field: Annotated[str, typer.Option("--field", help="Field shown by the colours.")] = "von_mises",
    view: Annotated[
        list[str] | None, typer.Option("--view", help="cut or surface; may be repeated; default: both.")
    ] = None,
    step: Annotated[int | None, typer.Option("--step", metavar="N", help="Default: the last written step.")] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Default: RUN/pictures.")] = None,
    animation: Annotated[bool, typer.Option(help="Draw the load path as a GIF (and MP4 with ffmpeg).")] = True,
    size: Annotated[str, typer.Option("--size", metavar="WxH", help="Size of a picture in pixels.")] = "1600x1000",
    whole: Annotated[
        bool, typer.Option("--whole", help="Draw nothing; write the whole scene's fields, mirrored, for ParaView.")
    ] = False,
) -> None:
    """Draw the deformed layer and its balls in three dimensions, and animate the load path."""
    from runs.commands.render import VIEWS, read_size, render_run  # noqa: PLC0415

    render_run(
        run, field=field, views=list(dict.fromkeys(view or VIEWS)), step=step, out=out, animation=animation,
        size=read_size(size), whole=whole,
    )  # fmt: skip


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run or a study.", show_default=False)],
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="Default: report.html in DIR.")] = None,
) -> None:
    """Write a self-contained HTML page about a run or a study: tables, figures, scene, versions, command."""
    from runs.reporting import report_folder  # noqa: PLC0415

    report_folder(folder, out)


@app.command()
def doctor(as_json: JsonOption = False) -> None:
    """Check the Python, DOLFINx, PETSc, MPI, BLAS and gmsh found on this machine; name faults and remedies."""
    from runs.commands.doctor import examine  # noqa: PLC0415

    raise typer.Exit(examine(as_json=as_json))


def main() -> None:
    """Run the command line; exit codes: 0 done, 1 failed, 2 bad input, 130 interrupted."""
    from runs.process.exit_codes import run_to_end  # noqa: PLC0415
    from runs.process.forwarding import forward_whole_lines  # noqa: PLC0415

    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the caller: the next file opened would take its number
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w", encoding="utf-8"))  # noqa: SIM115
    if not ranks.is_root():
        sys.stdout = sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  (only rank 0 prints)
    elif ranks.launched():
        forward_whole_lines()
    run_to_end(app)


if __name__ == "__main__":
    main()
