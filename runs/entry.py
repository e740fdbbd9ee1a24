"""The console script: starts the command line, or names the packages that it lacks."""

import sys


def main() -> None:
    """Run `runs.cli`; where its packages are absent, name them and the command that brings them."""
    try:
        from runs.cli import main as run  # noqa: PLC0415  (may be absent)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] in ("runs", "linear_bem", "finite_strain", "meshes"):
            raise
        sys.exit(
            f"thirdbody: error: the command line needs the package {error.name}, which {sys.executable} does not have: "
            'pip install "thirdbody[cli]" (from the checkout: pip install ".[cli]"); `import linear_bem` works without'
        )
    run()
