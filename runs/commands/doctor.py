"""The command ``doctor``: what is installed, what is wrong with it, and the command that repairs it."""

import json
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from runs.display import tables
from runs.process import ranks
from runs.process.json_values import to_json

SYSTEM_PYTHON = "/usr/bin/python3"
PACKAGES = {
    "petsc4py": "python3-petsc4py-real",
    "mpi4py": "python3-mpi4py",
    "dolfinx": "python3-dolfinx-real",
    "gmsh": "python3-gmsh",
    "h5py": "python3-h5py",
}
OVER_SYSTEM_PYTHON = f"{SYSTEM_PYTHON} -m venv --system-site-packages .venv && .venv/bin/pip install -e '.[cli]'"
INSTALL_PICTURES = "bash runs/setup.sh render"
OPTIONAL = {
    "clarabel": ("many balls in contact and rolling resistance need it in `thirdbody evolve`", "pip install clarabel"),
    "jinja2": ("`thirdbody report` needs it, and `thirdbody study` for most pages", "pip install jinja2"),
    "pyvista": ("`thirdbody render` needs it", INSTALL_PICTURES),
}
"""Packages that only some commands need: the command, and how to install the package."""
OLDEST_DOLFINX = "0.5.2"
LAUNCHED_BY_MPI = ("OMPI_COMM", "OMPI_UNIVERSE", "OMPI_MCA_ess", "OMPI_MCA_orte", "PMIX_", "PMI_", "PRTE_", "ORTE_")
PROBE = """
import importlib, json, sys
found = {}
for name in sys.argv[1].split(","):
    try:
        module = importlib.import_module(name)
        file = getattr(module, "__file__", None) or ""
        found[name] = {"version": str(getattr(module, "__version__", "")), "file": file}
    except BaseException as error:
        found[name] = {"error": f"{type(error).__name__}: {error}"}
if "version" in found.get("petsc4py", {}):
    from petsc4py import PETSc
    found["petsc4py"] |= {"library": ".".join(map(str, PETSc.Sys.getVersion())), "scalar": PETSc.ScalarType.__name__}
if "version" in found.get("mpi4py", {}):
    from mpi4py import MPI
    found["mpi4py"]["library"] = MPI.Get_library_version().split(",")[0].strip("\\0 \\n")
if "version" in found.get("numpy", {}):
    import numpy
    numpy.linalg.solve(numpy.eye(2), numpy.ones(2))
with open("/proc/self/maps") as maps:
    files = {line.split()[-1] for line in maps if "/" in line}
marks = ("libblas", "openblas", "libmkl_rt", "libmkl_core", "libblis", "libatlas", "libflexiblas")
blas = sorted(f for f in files if ".so" in f and any(mark in f.rsplit("/", 1)[-1] for mark in marks))
print(json.dumps({"python": sys.version.split()[0], "packages": found, "blas": blas}))
"""
"""Imports the packages in a separate process, because importing a broken package may kill the process."""


@dataclass(frozen=True)
class Package:
    """A package as one Python imports it, or the error; ``library``: version of PETSc, or name of the MPI library."""

    version: str = ""
    file: str = ""
    error: str = ""
    library: str = ""
    scalar: str = ""

    @property
    def folder(self) -> str:
        """Folder in which the package is installed."""
        return str(Path(self.file).parent)

    @property
    def of_debian(self) -> bool:
        """Whether the package comes from Debian."""
        return "/dist-packages/" in self.file or self.file.startswith("/usr/lib/")

    @property
    def is_wheel(self) -> bool:
        """Whether the package can be imported and comes from elsewhere."""
        return not self.error and not self.of_debian


@dataclass(frozen=True)
class Report:
    """What one Python imports: its version, packages by name, and the files of the BLAS that numpy loads."""

    python: str
    packages: Mapping[str, Package]
    blas: Sequence[str] = ()


@dataclass(frozen=True)
class Finding:
    """One item that was checked: what was found, what is wrong with it ("": nothing), and the remedy.

    ``blocks``: the finite-element models cannot run with this fault.
    """

    name: str
    found: str
    fault: str = ""
    remedy: str = ""
    blocks: bool = True


def examine(*, as_json: bool) -> int:
    """Print the findings; return 0, or 1 when the finite-element models cannot run."""
    if not ranks.is_root():
        return 0
    findings = look()
    wrong = [f for f in findings if f.fault]
    blocked = any(f.blocks for f in wrong)
    if as_json:
        document = {"findings": [asdict(f) for f in findings], "healthy": not wrong, "every_model_runs": not blocked}
        sys.stdout.write(to_json(document))
        return 1 if blocked else 0
    say = partial(tables.console().print, highlight=False, markup=False, soft_wrap=True)
    for finding in findings:
        mark = ("wrong" if finding.blocks else "slow") if finding.fault else "ok"
        say(f"{mark:6}{finding.name:10}{finding.found}")
        if finding.fault:
            say(f"{'':16}{finding.fault}")
            say(f"{'':16}repair: {finding.remedy}", style="bold")
    if blocked:
        say("linear_bem and point_load can run; finite_strain and small_strain cannot: repair the faults above")
    else:
        say("every model can run" + (", but the repairs above are advised" if wrong else ""))
    return 1 if blocked else 0


def look(python: str = sys.executable) -> list[Finding]:
    """Return all findings about ``python`` and the libraries that it would use."""
    report = probe(python, ["numpy", "scipy", *PACKAGES, *OPTIONAL])
    found = [_python(python, report)]
    found += [_numpy(report, python), *(_package(name, report, python) for name in PACKAGES), _blas(report)]
    return [*found, _launcher(), *(_optional(name, report) for name in OPTIONAL)]


def probe(python: str, names: Sequence[str]) -> Report:
    """Return what ``python`` imports, the packages in this order."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(LAUNCHED_BY_MPI)}
    try:
        done = subprocess.run(
            [python, "-c", PROBE, ",".join(names)], capture_output=True, text=True, timeout=120, env=env, check=False
        )
        said = json.loads(done.stdout.splitlines()[-1])
        packages = {name: Package(**package) for name, package in said["packages"].items()}
        return Report(said["python"], packages, said["blas"])
    except (OSError, subprocess.TimeoutExpired, ValueError, IndexError) as error:
        last = done.stderr.strip().splitlines()[-1:] if isinstance(error, ValueError | IndexError) else [str(error)]
        failure = Package(error=f"{python} ended while importing: {(last or ['no message'])[0]}")
        return Report("", dict.fromkeys(names, failure))


def _install(package: str) -> str:
    return f"{'' if os.geteuid() == 0 else 'sudo '}apt-get install --no-install-recommends {package}"


def _python(python: str, report: Report) -> Finding:
    found = f"{report.python or platform.python_version()}, {python}"
    if report.packages["dolfinx"].error and python != SYSTEM_PYTHON and Path(SYSTEM_PYTHON).exists():
        system = probe(SYSTEM_PYTHON, ["dolfinx"])
        if not system.packages["dolfinx"].error:
            has = f"{SYSTEM_PYTHON} (Python {system.python}) has DOLFINx {system.packages['dolfinx'].version}"
            return Finding("Python", found, f"this Python has no DOLFINx, {has}: use that one", OVER_SYSTEM_PYTHON)
    return Finding("Python", found)


def _numpy(report: Report, python: str) -> Finding:
    numpy, dolfinx, fault = report.packages["numpy"], report.packages["dolfinx"], ""
    if numpy.error:
        return Finding("numpy", "none", numpy.error, _install("python3-numpy"))
    if any("numpy" in package.error for package in report.packages.values()) and numpy.is_wheel:
        fault = "not the numpy that DOLFINx was built for"
    elif dolfinx.of_debian and numpy.is_wheel:
        fault = f"a wheel beside Debian's DOLFINx ({dolfinx.folder}), which was built for Debian's numpy"
    found = f"{numpy.version}, {numpy.folder}"
    wheels = " ".join(name for name in ("numpy", "scipy") if report.packages[name].is_wheel)
    return Finding("numpy", found, fault, f"{python} -m pip uninstall -y {wheels}" if fault else "")


def _package(name: str, report: Report, python: str) -> Finding:
    this, dolfinx, remedy = report.packages[name], report.packages["dolfinx"], _install(PACKAGES[name])
    if "numpy" in this.error and report.packages["numpy"].is_wheel:
        return Finding(name, "none", this.error, "that of numpy, above")
    if this.error:
        has_system = os.path.realpath(python) == os.path.realpath(SYSTEM_PYTHON)
        return Finding(name, "none", this.error, remedy if has_system else OVER_SYSTEM_PYTHON)
    found, fault = f"{this.version}, {this.folder}", ""
    match name:
        case "petsc4py":
            found = f"PETSc {this.library}, {this.scalar}, {this.folder}"
            if "complex" in this.scalar:
                fault, remedy = "PETSc is built for complex numbers", _install(PACKAGES["dolfinx"])
        case "mpi4py":
            found = f"{this.library}; mpi4py {found}"
        case "dolfinx" if _numbers(this.version) < _numbers(OLDEST_DOLFINX):
            fault = f"older than {OLDEST_DOLFINX}, the oldest that is supported"
        case "h5py" if dolfinx.of_debian and this.is_wheel:
            fault = "a wheel with an HDF5 of its own beside Debian's DOLFINx: it fails once DOLFINx is loaded"
            remedy = f"{python} -m pip uninstall -y h5py; {remedy}"
    return Finding(name, found, fault, remedy if fault else "")


def _blas(report: Report) -> Finding:
    found = ", ".join(report.blas) or "none found"
    if any("/blas/libblas.so" in library for library in report.blas):
        fault = "the reference BLAS: direct solvers take 5 to 6 times longer"
        return Finding("BLAS", found, fault, _install("libopenblas0-serial"), blocks=False)
    return Finding("BLAS", found)


def _optional(name: str, report: Report) -> Finding:
    this, (use, remedy) = report.packages[name], OPTIONAL[name]
    if not this.error:
        return Finding(name, f"{this.version}, {this.folder}")
    if f"No module named '{name}'" in this.error:
        return Finding(name, f"none: only {use} ({remedy})")
    return Finding(name, "broken", this.error, remedy, blocks=False)


def _launcher() -> Finding:
    launcher = shutil.which("mpirun")
    if launcher is None:
        return Finding("mpirun", "none", "several ranks cannot be started", _install("openmpi-bin"), blocks=False)
    return Finding("mpirun", os.path.realpath(launcher))


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split(".")[:3] if part.isdigit())
