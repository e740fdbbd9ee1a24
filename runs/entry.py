"""The console script: starts the command line, or says which packages are absent or do not fit together."""

import sys

OURS = ("runs", "linear_bem", "finite_strain", "meshes")


def main() -> None:
    """Run `runs.cli`; where packages are absent or do not fit together, say which, and how to repair that."""
    try:
        from runs.cli import main as run  # noqa: PLC0415  (may be absent)
    except AttributeError as error:
        if "module 'numpy" not in str(error):  # else scipy looks for what this numpy does not have
            raise
        sys.exit(f"thirdbody: error: {_unfit(error)}")
    except ImportError as error:
        if (error.name or "").split(".")[0] in OURS:
            raise
        words = _absent(str(error.name)) if isinstance(error, ModuleNotFoundError) else _unfit(error)
        sys.exit(f"thirdbody: error: {words}")
    run()


def _absent(name: str) -> str:
    return (
        f"the command line needs the package {name}, which {sys.executable} does not have: "
        'pip install "thirdbody[cli]" (from the checkout: pip install ".[cli]"); `import linear_bem` works without'
    )


def _unfit(error: Exception) -> str:
    return (
        f"packages of {sys.executable} do not fit together: {error}. A later pip may have brought a numpy, scipy or "
        "h5py that hides the system's; `bash runs/setup.sh` takes them out of the checkout's .venv again (elsewhere: "
        f'{sys.executable} -m pip install --force-reinstall "thirdbody[cli]")'
    )
