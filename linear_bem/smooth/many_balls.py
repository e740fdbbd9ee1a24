r"""Many smooth contacts: each ball is solved alone under fixed force; all together give forces and approaches.

Under a fixed force, neighbours act on a ball only through the tilt and curvature of the surface that they cause, which
is a weak coupling; the coupling through its approach is strong. So each sweep computes (1) the displacement from all
other balls, (2) one Newton step of every ball alone at its present force, which also gives its approach and its own
compliance s_i = dD_i/dQ_i, (3) new forces from the coarse system

    (diag(s) + K(L_ij)) dQ = D_wanted - D,

which point loads describe well, and (4) the change of every ball's pressure due to its new force, which acts on the
others in the next sweep. A sweep multiplies the error by the size of the shape coupling, 1e-2 to 1e-4 for separate
balls; for contacts that nearly touch, the error is only halved, and Anderson's mixing accelerates the sweeps. A sweep
costs n small dense systems and the sums of `linear_bem.smooth.multipole`.
"""

from dataclasses import replace
from operator import itemgetter

import numpy as np

from linear_bem.arrays import Array, Indices, Mask
from linear_bem.coupled_point_loads import Influence, solve_coupled
from linear_bem.errors import NotConverged
from linear_bem.layer.kernel import LayeredKernel
from linear_bem.load_control import Groups
from linear_bem.profiles import Height
from linear_bem.report import Report, seldom, silent
from linear_bem.smooth.multipole import Interaction
from linear_bem.smooth.newton import SETTLED, Nodes, Rule, SmoothSolution, stalled
from linear_bem.smooth.own_equations import RENEWED, OwnEquations
from linear_bem.smooth.polynomials import PARABOLA, basis, disc_nodes
from linear_bem.smooth.zone import Zone

SLOW, DEPTH = 0.2, 10
"""Ratio of successive changes above which sweeps are accelerated, and number of past sweeps that are combined."""
LIMIT = 60
"""Largest number of sweeps."""
HOPELESS, PATIENCE = 0.03, 10
"""Sweeps stop if their change stays above the first number and is not halved by the second number of further sweeps:
at that rate they would not converge within any limit."""
FAR, RESTARTS = 3.0, 6
"""Relative change of its coefficients above which a contact is restarted, and number of first sweeps that do so."""
LEAST_SHARE, LOST = 0.3, 4
"""Least share of its force that a ball keeps in one sweep; number of such sweeps in a row that mean lost contact."""


class Lost(NotConverged):
    """Balls lose their contact: ``kept`` are the indices of the others among those given, ``zones`` their zones."""

    def __init__(self, kept: Indices, zones: Zone) -> None:
        super().__init__("smooth contacts: a ball lost its contact during the sweeps")
        self.kept, self.zones = kept, zones


@np.errstate(all="ignore")  # diverging sweeps may overflow before they end
def sweep_zones(
    kernel: LayeredKernel,
    shapes: list[Height],
    zones: Zone,
    approaches: Array,
    groups: Groups,
    tolerance: float,
    pair_precision: float | None = None,
    report: Report = silent,
    apart: bool = False,
) -> SmoothSolution:
    """Return the same state as `linear_bem.smooth.newton.solve_zones`, for many balls.

    ``tolerance`` bounds the change of forces, approaches and coefficients in a sweep. Once `stalled`, the sweep with
    the smallest change is returned, with it as residual. ``pair_precision`` is that of `Interaction`, by default the
    tolerance; ``report`` receives a line per sweep. Zones that are ``apart`` do not act on each other. Raises `Lost` if
    a ball loses its contact, and `NotConverged`.
    """
    rule = Rule.of(zones, kernel.thickness)
    nodes = Nodes.of(zones, rule)
    said = seldom(report, f"degree {zones.degree}: ")
    interaction = None if apart else Interaction(kernel, nodes, pair_precision or tolerance, said)
    influence: Influence = np.zeros((len(zones), len(zones))) if interaction is None else interaction.influence
    images = 0.0
    if interaction is not None and kernel.cell is not None and kernel.far_ratio > 1.0:
        # what its own images add at a ball nearly cancels its own displacement of a soft base: they belong together
        images = float((interaction.influence @ np.eye(1, len(zones))[0])[0])
        interaction.influence.own += images
    equations = OwnEquations(kernel, rule, pair_precision or tolerance, images)
    forces = nodes.forces
    for members, force in groups:
        if len(members) == 1:
            forces[members[0]] = force
    shared = [(np.array(members), force) for members, force in groups if len(members) > 1]
    fixed = np.ones(len(zones), dtype=bool)
    fixed[[m for members, _ in groups for m in members]] = False
    values = basis(*disc_nodes(zones.degree + 4)[:2], zones.degree)
    # the matrix of an earlier frame misses some of the force, which moves all other balls on a soft base
    renewed = SETTLED if kernel.far_ratio > 1.0 else RENEWED
    mixing, slow = Anderson(), False
    history, best = list[float](), (np.inf, zones, approaches)
    sizes = np.ones(len(zones))
    shrinking = np.zeros(len(zones), dtype=int)
    for sweep in range(LIMIT):
        outside = np.zeros(nodes.x.shape) if interaction is None else interaction.displacement()
        outside -= images * nodes.forces[:, None]
        profile = np.array([shape(x, y) for shape, x, y in zip(shapes, nodes.x, nodes.y, strict=True)])
        step = f"degree {zones.degree}, sweep {sweep + 1}: "
        steps = equations.step(nodes, outside, profile, forces, sizes > renewed, seldom(report, step))
        before, found = nodes.zone, steps.approaches
        if kernel.far_ratio > 1.0:  # steps are of first order: their error in force displaces others far more there
            found = found + influence @ (forces - nodes.forces)
        wanted = np.where(fixed, approaches, found)
        more, level = _balance(influence, steps.compliances, found, forces, wanted, fixed, shared)
        new_forces = np.maximum(forces + more, LEAST_SHARE * forces)
        # the new force must act on the others in the next sweep: with a delay it oscillates, and may diverge
        changes = steps.changes + (new_forces - forces)[:, None] * steps.responses
        # coefficients of a high degree are far less certain than P, but a large change of P may be wrong at the edge
        sizes = np.max(np.abs(changes @ values), axis=1) / np.max(np.abs(before.coefficients @ values), axis=1)
        growth = np.max(np.abs(changes), axis=1) / np.max(np.abs(before.coefficients), axis=1)
        length = np.where(sizes > SETTLED, 0.6 / np.maximum(growth, 0.6), 1.0)
        zones = _moved(before, length[:, None] * changes, sizes > SETTLED)
        far = np.flatnonzero((growth > FAR) & (growth < np.inf) & (sweep < RESTARTS))
        zones = _restarted(zones, far, nodes, outside + profile, new_forces)
        relative = [more / np.max(forces), (level - found) / np.max(np.abs(found)), sizes]
        last = float(np.max(np.abs(relative)))
        history.append(last)
        best = min(best, (last, zones, level), key=itemgetter(0))
        earlier = min(history[:-PATIENCE], default=np.inf)
        if not np.isfinite(last) or min(history[-PATIENCE:]) > max(HOPELESS, 0.5 * earlier):
            raise NotConverged("smooth contacts: the sweeps diverged; press the balls less deep")
        report(f"{step}change {last:.1e}, tolerance {tolerance:.1e}")
        if last < tolerance or stalled(history):
            return SmoothSolution(Nodes.of(best[1], rule), best[2], sweep + 1, best[0])
        shrinking = np.where(forces + more < LEAST_SHARE * forces, shrinking + 1, 0)
        if np.any(shrinking >= LOST):
            kept = np.flatnonzero(shrinking == 0)
            if kept.size == 0:
                raise NotConverged(
                    "smooth contacts: all balls lost their contact during the sweeps; press the balls less deep or "
                    "closer to equal depth"
                )
            raise Lost(kept, zones[kept])
        slow = slow or (len(history) > 1 and last > SLOW * history[-2])
        if slow and np.max(sizes) <= SETTLED and not np.any(shrinking):
            zones, forces = _mixed(mixing, (before, forces), (zones, new_forces))
        else:
            mixing.forget()
            forces = new_forces
        nodes = Nodes.of(zones, rule)
        if interaction is not None:
            interaction.update(nodes)
    raise NotConverged(
        f"smooth contacts: {LIMIT} sweeps left a change of {last:.1e}, tolerance {tolerance:.1e}; press the balls "
        "less deep"
    )


def _moved(zones: Zone, change: Array, reframe: Mask) -> Zone:
    moved = replace(zones, coefficients=zones.coefficients + change)
    if not np.any(reframe):
        return moved
    new = moved[reframe].reframed(zones.degree)
    centre, axes, coefficients = moved.centre.copy(), moved.axes.copy(), moved.coefficients.copy()
    centre[reframe], axes[reframe], coefficients[reframe] = new.centre, new.axes, new.coefficients
    return Zone(centre, axes, zones.degree, coefficients)


def _restarted(zones: Zone, far: Indices, nodes: Nodes, rise: Array, forces: Array) -> Zone:
    """Return the zones, those ``far`` from their solution as Hertz's ellipses at the minimum of ``rise`` [m].

    On a deeply indented soft base a contact is not centred on its ball's axis, and the force of a lightly loaded one
    may be many times that of the first guess.
    """
    centre, axes, coefficients = zones.centre.copy(), zones.axes.copy(), zones.coefficients.copy()
    for i in far:
        old, (x, y) = nodes.zone[i], (nodes.xi[i], nodes.eta[i])
        terms = np.stack([x**0, x, y, 0.5 * x**2, x * y, 0.5 * y**2], axis=1)
        _, along, across, xx, xy, yy = np.linalg.lstsq(terms, rise[i], rcond=None)[0]
        bend = np.linalg.pinv([[xx, xy], [xy, yy]], rcond=1e-3)  # a flat direction has no minimum
        centre[i] = old.centre - old.axes @ bend @ (along, across)
        axes[i] = np.cbrt(forces[i] / nodes.forces[i]) * old.axes
        peak = 1.5 * forces[i] / (np.pi * abs(np.linalg.det(axes[i])))
        coefficients[i] = np.pad(peak**2 * PARABOLA, (0, coefficients.shape[1] - len(PARABOLA)))
    return Zone(centre, axes, zones.degree, coefficients)


def _balance(
    influence: Influence,
    compliance: Array,
    found: Array,
    forces: Array,
    level: Array,
    fixed: Mask,
    shared: list[tuple[Indices, float]],
) -> tuple[Array, Array]:
    """Return the changes of all forces and the resulting approaches.

    ``found`` are the approaches at the present forces, ``level`` the required ones. The forces of balls with ``fixed``
    or common approach change; all others keep their force.
    """
    free = fixed.copy()
    for members, _ in shared:
        free[members] = True
    more, level = np.zeros(len(found)), level.copy()
    if not np.any(free):
        return more, level
    missing = np.where(fixed, level, 0.0) - found
    more = solve_coupled(influence, compliance, missing, free)
    for members, force in shared:
        rising = solve_coupled(influence, compliance, np.isin(np.arange(len(found)), members).astype(float), free)
        common = (force - float(np.sum((forces + more)[members]))) / float(np.sum(rising[members]))
        more, level[members] = more + common * rising, common
    return more, level


class Anderson:
    """Anderson's mixing [Anderson 1965, J. ACM 12, 547; Walker and Ni 2011, SIAM J. Numer. Anal. 49, 1715].

    It combines past iterates so that their residuals cancel best; for a linear iteration x -> G(x) it is equivalent
    to GMRES, so that a few slow components no longer determine the rate of convergence.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Drop the past iterates, for example if the unknowns change their meaning."""
        self._points: list[Array] = []
        self._residuals: list[Array] = []

    def next(self, point: Array, image: Array, scale: Array) -> Array:
        """Return the next point from G(``point``) = ``image``; residuals over ``scale`` are combined."""
        self._points = [*self._points[-DEPTH:], point]
        self._residuals = [*self._residuals[-DEPTH:], image - point]
        if len(self._points) < 2:
            return image
        steps, changes = np.diff(self._points, axis=0), np.diff(self._residuals, axis=0)
        weights = np.linalg.lstsq((changes / scale).T, self._residuals[-1] / scale, rcond=1e-10)[0]
        return np.asarray(image - weights @ (steps + changes))


def _mixed(mixing: Anderson, old: tuple[Zone, Array], new: tuple[Zone, Array]) -> tuple[Zone, Array]:
    """Return accelerated zones and forces; coefficients are scaled by the largest of each zone."""
    before = old[0].coefficients
    count, terms = before.shape
    size = np.repeat(np.max(np.abs(before), axis=1), terms)
    point, image = (np.concatenate([zones.coefficients.ravel(), forces]) for zones, forces in (old, new))
    mixed = mixing.next(point, image, np.concatenate([size, np.full(count, np.max(old[1]))]))
    if np.any(mixed[-count:] <= 0.0):
        mixing.forget()
        return new
    return replace(old[0], coefficients=mixed[:-count].reshape(count, terms)), mixed[-count:]
