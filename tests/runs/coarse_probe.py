"""The probe of the study effects, with elements that grow fast and answer in one load step."""

import sys
from functools import partial
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

ROOT = Path(__file__).parents[2]
# by its file: nothing of the project is imported earlier
spec = spec_from_file_location("probe", ROOT / "runs" / "studies" / "effects" / "probe.py")
assert spec is not None
assert spec.loader is not None
probe = module_from_spec(spec)
spec.loader.exec_module(probe)
watch_forms = probe.watch_forms


def coarser(signatures: list[str]) -> None:
    watch_forms(signatures)
    import finite_strain  # noqa: PLC0415

    one_step = partial(finite_strain.Numerics, growth=4.0, more_loads=(), largest_step=0.2)
    finite_strain.Numerics = one_step  # type: ignore[misc, assignment]


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    probe.watch_forms = coarser
    sys.exit(probe.main(Path(sys.argv[1]), sys.argv[2].split(","), sys.argv[3:]))
