"""Child process that runs one command and reports the modules, forms and functions that it used.

Modules and functions ("module:name") named on its command line are blocked, as if their code did not exist. It is run
as a file, so that nothing of the project is imported earlier:
``python -P probe.py ACCOUNT BLOCKED COMMAND...``, BLOCKED separated by commas.
"""

import json
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from inspect import CO_OPTIMIZED
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any

OURS = ("linear_bem", "meshes", "finite_strain", "runs")
COMPILING = ("ply", "pycparser", "setuptools", "libffcx_")
"""Prefixes of libraries that are loaded only if a form is not yet in the compiler's cache."""


class Absent:
    """An import finder that blocks modules: importing one fails as if its file were missing."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = frozenset(names)

    def find_spec(self, name: str, path: Any = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Raise for a blocked module; leave all others to the next finder."""
        if name in self.names:
            raise ModuleNotFoundError(f"No module named {name!r} (refused by the study effects)", name=name)
        return None


class Calls:
    """A profiler that records which of the project's functions are called, and blocks some."""

    def __init__(self, refused: Sequence[str]) -> None:
        self.refused = frozenset(refused)
        self.names: dict[CodeType, str] = {}

    def __call__(self, frame: FrameType, event: str, _argument: Any) -> None:
        """Record a call; raise if the function is blocked."""
        if event == "call" and frame.f_code not in self.names:
            code, module = frame.f_code, frame.f_globals.get("__name__", "")
            ours = module.split(".")[0] in OURS and not module.startswith("runs.studies")
            # module and class bodies run on import, which the list of modules covers
            named = code.co_flags & CO_OPTIMIZED and not code.co_qualname.endswith(">")
            self.names[code] = f"{module}:{code.co_qualname}" if ours and named else ""
            if self.names[code] in self.refused:
                raise NotImplementedError(f"{self.names[code]} (refused by the study effects)")

    def found(self) -> list[str]:
        """Return the names of all functions that were called."""
        return sorted(set(self.names.values()) - {""})


def watch_forms(signatures: list[str]) -> None:
    """Record the signature of every variational form that finite_strain compiles from now on."""
    from finite_strain import compat  # noqa: PLC0415  (imports DOLFINx)

    compile_form = compat.compile_form

    def noting(form: Any, *arguments: Any) -> Any:
        parts = form if isinstance(form, list | tuple) else [form]
        flat = [one for part in parts for one in (part if isinstance(part, list | tuple) else [part])]
        signatures.extend(one.signature() for one in flat if one is not None)
        return compile_form(form, *arguments)

    compat.compile_form = noting  # type: ignore[assignment]


def main(account: Path, blocked: Sequence[str], command: Sequence[str]) -> int:
    """Run the command in this process and write the account as JSON."""
    sys.meta_path.insert(0, Absent([name for name in blocked if name and ":" not in name]))
    calls, signatures = Calls([name for name in blocked if ":" in name]), list[str]()
    sys.setprofile(calls)
    if "--forms" in command:
        watch_forms(signatures)
    from runs import cli  # noqa: PLC0415

    sys.argv = ["thirdbody", *(word for word in command if word != "--forms")]
    code = 0
    try:
        cli.main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    sys.setprofile(None)
    found = {"modules": sorted(filter(_counts, sys.modules)), "functions": calls.found(), "forms": signatures}
    account.write_text(json.dumps(found), encoding="utf-8")
    return code


def _counts(module: str) -> bool:
    """Return whether a loaded module is one of the project's (except studies) or the top level of a library."""
    if module.split(".", maxsplit=1)[0] in OURS:
        return not module.startswith("runs.studies")
    standard = module in sys.stdlib_module_names or module.startswith("_")
    return "." not in module and not standard and not module.startswith(COMPILING)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[3]))
    sys.exit(main(Path(sys.argv[1]), sys.argv[2].split(","), sys.argv[3:]))
