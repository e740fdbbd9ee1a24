"""The choice of solver for Newton's linear systems, by their size and the form of the elements (without PETSc).

Factors (MUMPS, LDL^T) are fastest for small systems, but their cost grows faster than the size; the cost of a Krylov
method with multigrid over the elements' order grows little faster than the size (`thirdbody study scaling`). The
user's PETSc options with the prefix ``thirdbody_`` take precedence.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from linear_bem.counts import grouped

PREFIX = "thirdbody_"
DIRECT_UP_TO = 200_000
"""Largest number of unknowns solved by factors; ``-thirdbody_direct_up_to N`` sets another number."""
DIRECT_AT_ORDER_4 = 250_000
"""The same at order 4: with 204 thousand unknowns the thin pair takes four times as long by multigrid."""
FACTORISATIONS = ("lu", "cholesky")

FACTORS = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_14": "80",
    "mat_mumps_icntl_20": "0",
}
"""LDL^T by MUMPS: the tangent is symmetric, and indefinite in the mixed form or after wrinkling."""
KRYLOV = {"ksp_type": "fgmres", "ksp_gmres_restart": "60", "ksp_rtol": "1e-2", "ksp_max_it": "120"}
"""Not conjugate gradients: a deformed layer under contact may have an indefinite tangent.

Newton's method requires 3e-2 to 1e-3 of its residual, and repeats the solve if 1e-2 is not enough.
"""
MULTIGRID = {
    "pc_type": "mg",
    "pc_mg_galerkin": "both",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": "2",
    "mg_levels_pc_type": "sor",
}
"""Levels of lower order, see `order_levels.py`, for the displacement's rows; smoothed by nodal Gauss-Seidel.

Other smoothers and levels: `thirdbody study scaling`.
"""
LOWEST_BY_FACTORS = {
    "mg_coarse_ksp_type": "preonly",
    **{f"mg_coarse_{key}": value for key, value in FACTORS.items() if key != "ksp_type"},
}
LOWEST_BY_MULTIGRID = {
    "mg_coarse_ksp_type": "preonly",
    "mg_coarse_pc_type": "gamg",
    "mg_coarse_pc_gamg_threshold": "0.01",
}
"""The lowest order above the range of factors: smoothed aggregation, with translations but no rotations."""
PRESSURE = {
    "ksp_type": "chebyshev",
    "ksp_max_it": "1",
    "ksp_convergence_test": "skip",
    "pc_type": "sor",
    "pc_sor_its": "4",
}
"""The mass matrix over the stiffness, scaled by the largest eigenvalue of the Schur complement preconditioned by it.

Deep under a ball the layer without its pressure is nearly unstable and the complement far larger than the mass matrix;
four sweeps invert this as well as factors (`thirdbody study scaling`). An incompressible layer that is much wider than
thick is like a lubricating film, which a mass matrix does not approximate: there factors may have to take over.
"""
DISPLACEMENT = "fieldsplit_displacement_"
FIELD_SPLIT = {
    "pc_type": "fieldsplit",
    "pc_fieldsplit_type": "schur",
    "pc_fieldsplit_schur_fact_type": "upper",
    "pc_fieldsplit_schur_precondition": "user",
    f"{DISPLACEMENT}ksp_type": "preonly",
    **{f"fieldsplit_pressure_{key}": value for key, value in PRESSURE.items()},
}
"""Upper block triangle for the mixed form.

[Elman Silvester Wathen 2014, doi 10.1093/acprof:oso/9780199678792.001.0001]
"""


@dataclass(frozen=True)
class Choice:
    """The options of a solver, and the reason for the choice; ``direct``: by factors."""

    options: Mapping[str, str]
    direct: bool
    why: str

    @property
    def method(self) -> str:
        """The solver in PETSc's words, such as "fgmres + gamg" or "cholesky (mumps)"."""
        if self.direct:
            solver = self.options.get("pc_factor_mat_solver_type")
            return self.options["pc_type"] + (f" ({solver})" if solver else "")
        return f"{self.options['ksp_type']} + {self.options['pc_type']}"

    def describe(self) -> str:
        """Return the solver and the reason in one phrase."""
        return f"{self.method}: {self.why}"


def choose(unknowns: float, mixed: bool, given: Mapping[str, str], order: int = 3) -> Choice:
    """Return the solver for a system; ``given`` are the user's options, without the prefix.

    A preconditioner chosen by the user determines the other options: factors need no iteration, all others do.
    """
    limit = float(given.get("direct_up_to", DIRECT_UP_TO if order < 4 else DIRECT_AT_ORDER_4))
    if "pc_type" in given or "ksp_type" in given:
        direct = given["pc_type"] in FACTORISATIONS if "pc_type" in given else given["ksp_type"] == "preonly"
        why = f"by the options of the prefix {PREFIX}"
    else:
        direct = unknowns <= limit
        why = f"{'up to' if direct else 'more than'} {grouped(limit)} unknowns"
    usual = FACTORS if direct else KRYLOV | _multigrid(mixed, unknowns / order**3)
    return Choice(usual | {key: value for key, value in given.items() if key != "direct_up_to"}, direct, why)


def along(unknowns: float, order: int, mixed: bool) -> tuple[int, ...]:
    """Return the orders along the layer of multigrid's lower levels that keep their order across it.

    Empty if the lowest level would be too large for factors.
    """
    return () if unknowns / order**2 > DIRECT_UP_TO else (2, 1) if mixed else (1,)


def _multigrid(mixed: bool, lowest: float) -> dict[str, str]:
    """Return the options of the preconditioner; ``lowest`` is about the number of unknowns of order 1."""
    levels = MULTIGRID | (LOWEST_BY_FACTORS if lowest <= DIRECT_UP_TO else LOWEST_BY_MULTIGRID)
    return FIELD_SPLIT | {f"{DISPLACEMENT}{key}": value for key, value in levels.items()} if mixed else levels


def factor_bytes(unknowns: float) -> float:
    """Return the memory of factors [bytes]: 17 kB per unknown at 50 thousand, grows as n^(4/3) (nested dissection)."""
    return 17e3 * unknowns * (unknowns / 5e4) ** (1.0 / 3.0)


def given_in(text: str) -> dict[str, str]:
    """Return the options of our prefix in a line such as the environment's PETSC_OPTIONS, without the prefix."""
    words, found = text.split(), {}
    for word, after in zip(words, [*words, "-"][1:], strict=True):
        if word.startswith(f"-{PREFIX}"):
            found[word[len(PREFIX) + 1 :]] = "" if after.startswith("-") and not after[1:2].isdigit() else after
    return found


def solver_notes(method: str, failures: int, unused: list[str]) -> list[str]:
    """Return notes on a Krylov method that failed, and on the user's options that no solver has read."""
    notes = []
    if failures:
        notes.append(f"linear systems: {method} did not converge {failures} time(s); factors (MUMPS) replaced it")
    if unused:
        notes.append(
            f"PETSC_OPTIONS or solver_options: no solver of this run ({method}) has read {', '.join(unused)}; "
            "check the spelling"
        )
    return notes
