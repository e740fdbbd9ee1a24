"""What may import what, and what a scene that is solved by the linear model never loads."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.launch import ROOT, python

OURS = {"linear_bem", "meshes", "finite_strain", "runs", "tests"}
HEAVY = {"dolfinx", "ufl", "basix", "petsc4py", "mpi4py", "gmsh", "h5py"}
_SHARED = ("problem", "media", "indenter", "law", "result", "errors", "closed_forms")
SHARED_WORDS = {f"linear_bem.{name}" for name in _SHARED}
MAY_IMPORT = {
    "linear_bem": set[str](),
    "meshes": SHARED_WORDS - {"linear_bem.result"},
    "finite_strain": SHARED_WORDS
    | {f"linear_bem.{name}" for name in ("counts", "depth", "doubts", "dual", "layer.kernel", "memory", "solver")}
    | {"meshes"},
    "runs": {"linear_bem", "meshes", "finite_strain"},
}
THIRD_PARTY = {
    "linear_bem": {"numpy", "scipy"},
    "meshes": {"numpy", "scipy", "gmsh"},
    "finite_strain": {"numpy", "scipy", "dolfinx", "ufl", "basix", "petsc4py", "mpi4py", "h5py", "gmsh"},
}


def imports(file: Path) -> Iterator[tuple[str, int, bool]]:
    """Yield each absolute module name that ``file`` imports, its line, and whether importing the file runs it."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    deferred = {
        id(inner)
        for outer in ast.walk(tree)
        if isinstance(outer, ast.FunctionDef | ast.AsyncFunctionDef | ast.If)
        and (not isinstance(outer, ast.If) or "TYPE_CHECKING" in ast.dump(outer.test))
        for inner in ast.walk(outer)
    }
    for node in ast.walk(tree):
        at_once = id(node) not in deferred
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno, at_once) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}:{node.lineno}: relative import"
            module = node.module or ""
            for alias in node.names:
                submodule = ROOT.joinpath(*module.split("."), alias.name)
                is_module = submodule.with_suffix(".py").exists() or submodule.is_dir()
                name = f"{module}.{alias.name}" if is_module else module
                yield name, node.lineno, at_once


def sources(package: str) -> list[Path]:
    files = sorted((ROOT / package).rglob("*.py"))
    assert files, f"{package} holds no source"
    return files


def within(name: str, allowed: set[str]) -> bool:
    return any(name == root or name.startswith(f"{root}.") for root in allowed)


@pytest.mark.parametrize("package", sorted(MAY_IMPORT))
def test_imports_between_packages_follow_the_arrows(package: str) -> None:
    allowed = MAY_IMPORT[package] | {package}
    wrong = [
        f"{file.relative_to(ROOT)}:{line} imports {name}"
        for file in sources(package)
        for name, line, _ in imports(file)
        if name.split(".")[0] in OURS and not within(name, allowed)
    ]
    assert not wrong, wrong


def part_of(module: str) -> str:
    """Return the sub-package or file of a package that a module belongs to: "contact" of finite_strain.contact.x."""
    return module.split(".")[1] if "." in module else ""


@pytest.mark.parametrize("package", sorted(MAY_IMPORT))
def test_imports_between_the_parts_of_a_package_never_lead_back(package: str) -> None:
    leads: dict[str, set[str]] = {}
    for file in sources(package):
        here = part_of(".".join(file.relative_to(ROOT).with_suffix("").parts))
        if here in ("__init__", "cli"):  # they start what is named to them, and nothing needs them
            continue
        there = {part_of(name) for name, _, _ in imports(file) if within(name, {package})}
        leads.setdefault(here, set()).update(there - {here, "", "cli"})

    def reached(start: str) -> set[str]:
        found: set[str] = set()
        waiting = [start]
        while waiting:
            new = leads.get(waiting.pop(), set()) - found
            found |= new
            waiting += new
        return found

    circles = {part for part in leads if part in reached(part)}
    assert not circles, f"{package}: {sorted(circles)} import each other"


DEFERRED = {"linear_bem": {"matplotlib", "SurfaceTopography"}}
"""Libraries that a package may import inside functions: for what only some users ask."""


@pytest.mark.parametrize("package", sorted(THIRD_PARTY))
def test_a_solver_package_uses_no_other_library_than_its_own(package: str) -> None:
    import sys  # noqa: PLC0415

    known = THIRD_PARTY[package] | OURS | set(sys.stdlib_module_names)
    wrong = [
        f"{file.relative_to(ROOT)}:{line} imports {name}"
        for file in sources(package)
        for name, line, at_once in imports(file)
        if name.split(".")[0] not in known | (set() if at_once else DEFERRED.get(package, set()))
    ]
    assert not wrong, wrong


def test_the_command_line_defers_every_library_of_the_finite_elements() -> None:
    wrong = [
        f"{file.relative_to(ROOT)}:{line} imports {name}"
        for file in sources("runs")
        for name, line, at_once in imports(file)
        if at_once and name.split(".")[0] in HEAVY | {"finite_strain", "meshes", "matplotlib", "pint"}
    ]
    assert not wrong, wrong


def looks_at_a_version(node: ast.AST) -> bool:
    """Whether code asks which version it runs on: by its number, by what a module has, or by what it raises."""
    if isinstance(node, ast.Attribute | ast.Name):
        return (node.attr if isinstance(node, ast.Attribute) else node.id) in {"__version__", "VERSION", "hasattr"}
    if isinstance(node, ast.ExceptHandler):
        return "ImportError" in ast.dump(node) or "AttributeError" in ast.dump(node)
    return isinstance(node, ast.Call) and ast.unparse(node.func) == "getattr" and len(node.args) == 3


def test_one_file_alone_knows_the_versions_of_dolfinx() -> None:
    found = {
        file.relative_to(ROOT): [node.lineno for node in ast.walk(tree) if looks_at_a_version(node)]
        for package in ("meshes", "finite_strain", "tests/finite_strain", "tests/meshes")
        for file in sources(package)
        if (tree := ast.parse(file.read_text(encoding="utf-8")))
    }
    assert found.pop(Path("finite_strain/compat.py"))
    assert not {file: lines for file, lines in found.items() if lines}


def test_classes_that_hold_arrays_compare_without_asking_an_array_for_its_truth() -> None:
    wrong = [
        f"{file.relative_to(ROOT)}: {made.name}"
        for package in MAY_IMPORT
        for file in sources(package)
        for made in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(made, ast.ClassDef)
        and any("dataclass" in text and "eq=False" not in text for text in map(ast.unparse, made.decorator_list))
        and not any(isinstance(part, ast.FunctionDef) and part.name == "__eq__" for part in made.body)
        and any(isinstance(part, ast.AnnAssign) and holds_an_array(part.annotation) for part in made.body)
    ]
    assert not wrong, f"give {wrong} eq=False"


def holds_an_array(annotation: ast.expr) -> bool:
    text = re.sub(r"Callable\[.*\]", "", ast.unparse(annotation))
    return re.search(r"\b(Array|Mask|Indices|Pairs|ndarray)\b", text) is not None


def test_no_file_holds_two_ideas() -> None:
    long = {
        str(file.relative_to(ROOT)): count
        for package in MAY_IMPORT
        for file in sources(package)
        if (count := len(file.read_text(encoding="utf-8").splitlines())) > 320
    }
    assert not long, long


def test_the_top_level_holds_what_the_layout_names() -> None:
    packages = {p.name for p in ROOT.iterdir() if (p / "__init__.py").exists()}
    assert packages == OURS
    for name in ("pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", ".ci/run"):
        assert (ROOT / name).exists(), name


LOADED = """
import sys
sys.argv = ["thirdbody", *sys.argv[1:]]
from runs.cli import main
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
loaded = {name.split(".")[0] for name in sys.modules}
print("LOADED", *sorted(loaded), file=sys.stderr)
"""


@pytest.mark.parametrize("command", [("solve", "--json"), ("plan",)], ids=["solve", "plan"])
def test_a_scene_without_finite_strain_never_loads_dolfinx(command: tuple[str, ...], tmp_path: Path) -> None:
    out = ("--out", str(tmp_path / "out")) if command[0] == "solve" else ()
    done = python("-c", LOADED, *command, ROOT / "runs/scenes/paper_thin_pair_linear.toml", *out)
    assert done.returncode == 0, done.stderr
    loaded = set(done.stderr.split("LOADED")[1].split())
    assert "linear_bem" in loaded
    assert not loaded & HEAVY
    assert "finite_strain" not in loaded


def test_importing_the_linear_model_loads_numpy_and_scipy_alone() -> None:
    done = python("-c", "import linear_bem, sys; print(*{m.split('.')[0] for m in sys.modules})")
    assert done.returncode == 0, done.stderr
    third_party = {"pydantic", "pint", "typer", "rich", "matplotlib"} | HEAVY
    assert not set(done.stdout.split()) & third_party
