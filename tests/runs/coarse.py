"""The command line with real finite elements that grow fast and answer only at the loads that are asked for."""

from __future__ import annotations

from functools import partial


def main() -> None:
    """Run the command line; see `tests.finite_strain.scenes.COARSER`."""
    import finite_strain  # noqa: PLC0415
    from runs import cli  # noqa: PLC0415

    coarser = partial(finite_strain.Numerics, growth=4.0, more_loads=())
    finite_strain.Numerics = coarser  # type: ignore[misc, assignment]
    cli.main()


if __name__ == "__main__":
    main()
