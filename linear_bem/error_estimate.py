"""Error estimates of T and of all other results."""

import math

import numpy as np

from linear_bem.arrays import Array
from linear_bem.dual import has_kinks
from linear_bem.grid.contacts import GridContacts
from linear_bem.indenter import Cone, Ellipsoid, Indenter, Paraboloid, Punch, Sphere
from linear_bem.lifted_balls import Contacts, overlapping
from linear_bem.load_control import deepest
from linear_bem.smooth.contacts import SmoothContacts
from linear_bem.smooth.tangential_forces import half_space_pulls, layer_pulls

LEAST = 1e-9
"""Smallest relative error of all quantities: that of the kernel's table."""
IN_CELL, IN_CELL_COARSE = 1e-8, 3e-7
"""Relative error of sums in a periodic cell with the finest rule (`kernel_split.IN_CELL`) and with that before it."""
LIGHT = 0.1
"""Relative error of a ball's force per gap in contact over its own depth (up to 0.04 measured), see `_light_shares`."""
KINK = 20.0
"""Factor on error estimates with polynomials under bodies with kinks: for 32 pairs and single bodies the estimates were
up to 15 times too small."""


ON_GRID, ON_GRID_SHARP, UNCANCELLED, UNCANCELLED_THIN, LOCAL = 0.6, 1.2, 0.03, 0.3, 0.15
"""Least error of T on a grid over the square of cell over contact radius or, if it is smaller, the thickness of a soft
layer. Shares of the largest T (under balls, paraboloids and ellipsoids; under others), and of the largest T without its
cancellation (`felt`; more of it where a soft layer is thin against the contact). All are multiplied by the local share
of approaches, `_local_share`, at least `LOCAL`. Two grids may agree by chance: errors were up to 96 times their change,
and at most 0.8 times the estimates with this bound (`python -m tests.linear_bem.grid_bars 120 1`, and 2, 3, 4)."""


def pulls(contacts: Contacts, softest: float = 0.0, fading: float = math.inf) -> Array:
    """Return `half_space_pulls` [N] on every ball; in a periodic cell, neighbouring images count too."""
    return half_space_pulls(contacts.kernel, *_with_images(contacts), softest, fading)[: contacts.problem.size]


def felt(contacts: Contacts) -> Array:
    """Return `layer_pulls` [N] on every ball: the change of T per relative change of all pressures."""
    if isinstance(contacts, SmoothContacts):
        reach = float(np.max(contacts.zones.reach))
    else:
        reach = math.sqrt(float(np.max(contacts.contact_areas)) / math.pi)
    return layer_pulls(contacts.kernel, *_with_images(contacts), reach)[: contacts.problem.size]


def size_of_errors(contacts: Contacts) -> Array:
    """Return the change of T [N] on every ball per relative change of pressures: `pulls`, on a softer base `felt`."""
    return felt(contacts) if contacts.kernel.far_ratio > 1.0 else pulls(contacts)


def _with_images(contacts: Contacts) -> tuple[Array, Array]:
    """Return positions [m] and forces [N] of all balls and, in a periodic cell, of their neighbouring images."""
    positions, forces = contacts.problem.positions, contacts.normal_forces
    if contacts.problem.periodic is not None:
        shifts = np.array([(0, 0), *((m, n) for m in (-1, 0, 1) for n in (-1, 0, 1) if m or n)])
        shifts = shifts * contacts.problem.periodic.lengths
        positions, forces = (positions + shifts[:, None, :]).reshape(-1, 2), np.tile(forces, len(shifts))
    return positions, forces


def reference_force(contacts: Contacts) -> float:
    """Return the force [N] to which the accuracy of T refers: the largest T, at least 1e-4 of T on a half-space.

    Infinite for a single ball, which has no T: then the accuracy of forces and approaches decides.
    """
    if contacts.problem.size == 1:
        return math.inf
    largest = float(np.max(np.abs(contacts.mutual_force)))
    return max(largest, 1e-4 * float(np.max(pulls(contacts))), 1e-12 * float(np.max(contacts.normal_forces)))


def least_error(contacts: Contacts) -> Array:
    """Return the error of T [N] on every ball from the kernel's table and the solver's tolerance."""
    thickness, contrast = contacts.kernel.thickness, 1.0 + contacts.kernel.far_ratio
    softest = thickness if np.isfinite(thickness) else 0.0
    # the table's error fades where the layer's 1/r and the substrate's cancel
    return np.asarray(1e-9 * contrast * pulls(contacts, softest, 100.0 * contrast * thickness))


def least_share(contacts: Contacts) -> float:
    """Return the least relative error of all quantities: `LEAST`, and that of the sums in a periodic cell.

    The latter is relative to the dent of all forces, which the images nearly cancel on a base softer than the layer.
    """
    kernel = contacts.kernel
    if kernel.cell is None or not isinstance(contacts, SmoothContacts):
        return LEAST
    dent = max(float(kernel.smooth(0.0)), 1.0 / float(np.min(kernel.cell.lengths)))
    dent *= kernel.singular * float(np.sum(contacts.normal_forces))
    of_sums = IN_CELL if contacts.precision < 1e-7 else IN_CELL_COARSE
    return LEAST + of_sums * dent / deepest(contacts.approaches)


def route_difference(contacts: Contacts) -> Array:
    """Return the difference [N] between T by the mutual formula and T by the slope integral, per ball."""
    return np.asarray(np.max(np.abs(contacts.mutual_force - contacts.slope_force), axis=1))


def error_of_one(contacts: SmoothContacts) -> Array:
    """Estimate the error of T [N] on every ball from one solution: its residual, and its T by two formulas."""
    residual = max(contacts.gap_in_contact, float(np.max(_light_shares(contacts)))) * size_of_errors(contacts)
    return np.maximum(np.maximum(3.0 * route_difference(contacts), residual), least_error(contacts))


def _light_shares(contacts: SmoothContacts) -> Array:
    """Return the relative error of every force by the gap over the ball's own depth, 0 outside the `sample`.

    The own depth is that into a half-space of the layer's material by Hertz: in the dent of other balls it is much
    smaller than the approach. Six bodies in a dent had errors up to 0.04 times this ratio. The dent of a softer base is
    common to all balls, and so is its error: there the largest gap counts.
    """
    shares, touching = np.zeros(contacts.problem.size), [contacts.touching[k] for k in contacts.sample]
    radius = np.sqrt(contacts.contact_areas[touching] / math.pi)
    own = 0.75 * math.pi * contacts.kernel.singular * contacts.normal_forces[touching] / radius
    gaps = contacts.gaps_in_contact
    shares[touching] = LIGHT * (np.max(gaps) if contacts.kernel.far_ratio > 1.0 else gaps) / own
    return shares


def error_of_one_grid(contacts: GridContacts) -> Array:
    """Estimate the error of T [N] on every ball from the size of the cells, see `ON_GRID`."""
    local, thickness = _local_share(contacts), contacts.kernel.thickness
    # the layer takes a part of the approach that its base cannot take: its thickness counts
    is_soft = not contacts.kernel.homogeneous and contacts.kernel.far_ratio * local < 0.9
    radius = math.sqrt(float(np.max(contacts.contact_areas)) / math.pi)
    thin = min(1.0, radius / thickness) if is_soft else 0.0
    fine = max(contacts.coarseness, contacts.resolution / thickness if is_soft else 0.0)
    smooth = all(isinstance(ball.indenter, Sphere | Paraboloid | Ellipsoid) for ball in contacts.problem.balls)
    size = (ON_GRID if smooth else ON_GRID_SHARP) * np.max(np.abs(contacts.mutual_force))
    size += (UNCANCELLED + UNCANCELLED_THIN * thin**2) * np.max(felt(contacts))
    return np.full(contacts.problem.size, min(1.0, max(LOCAL, local)) * fine**2 * float(size))


def error_by_change(contacts: GridContacts, change: Array, known: Array | None) -> Array:
    """Return the error of T [N] on the finer of two grids, from its change and the estimate on the coarser, if any.

    The change of contacts that merge counts twice: they may converge as slowly as the side of the cells.
    """
    merged = any(len(patch.members) > 1 for patch in contacts.patches.patches)
    error = np.maximum((2.0 if merged else 1.0) * change, error_of_one_grid(contacts))
    return error if known is None else np.maximum(error, 0.25 * known)


def _local_share(contacts: GridContacts) -> float:
    """Return the largest approach of a half-space of the layer's material over the approach, by Hertz.

    Under a stiff film on a soft base it is small: cells hardly change the base's deformation, the larger part.
    """
    touching = contacts.normal_forces > 0.0
    radius = np.sqrt(contacts.contact_areas[touching] / math.pi)
    local = 0.75 * math.pi * contacts.kernel.singular * contacts.normal_forces[touching] / radius
    given = np.abs(contacts.approaches[touching])
    return float(np.max(np.divide(local, given, out=np.ones_like(local), where=given > 0.0)))


def change(before: Contacts, after: Contacts) -> tuple[Array, float]:
    """Return the change of every T [N] and the largest relative change of loads and approaches.

    With polynomials, a tenth of the changes of area and peak pressure counts too. On grids these are too noisy; there
    the error of loads and approaches from the unknown position of the edges within cells counts.
    """
    error = np.maximum(np.max(np.abs(after.mutual_force - before.mutual_force), axis=1), least_error(after))
    loads = float(np.max(np.abs(after.normal_forces - before.normal_forces)) / np.max(after.normal_forces))
    touching = after.normal_forces > 0.0
    moved = np.abs(after.approaches - before.approaches)[touching]
    settled = max(loads, float(np.max(moved) / np.max(np.abs(after.approaches[touching]))))
    if isinstance(after, GridContacts):
        settled = max(settled, float(np.max(after.edge_shares)))
    if isinstance(after, SmoothContacts) and isinstance(before, SmoothContacts):
        pairs = (before.contact_areas, after.contact_areas), (before.peak_pressures, after.peak_pressures)
        for old, new in pairs:
            settled = max(settled, 0.1 * float(np.max(np.abs(new - old)[touching] / new[touching])))
    return error, settled


Errors = dict[str, Array]
"""Absolute errors of normal forces [N], approaches [m], peak pressures [Pa] and contact areas [m^2], by name."""


def quantities(contacts: Contacts) -> Errors:
    """Return the quantities to which `Errors` refer, one entry per ball each."""
    return {
        "normal_force": contacts.normal_forces,
        "approach": contacts.approaches,
        "peak_pressure": contacts.peak_pressures,
        "contact_area": contacts.contact_areas,
    }


def errors_of_one(contacts: Contacts) -> Errors:
    """Return error estimates from one solution, by its residual; on a grid by its coarseness.

    With polynomials of degree d, a gap g in contact is corrected by pressures of about g k/(2 pi singular), the
    half-space's response at the largest wave number that the polynomials resolve, k = 4 d/a; forces and approaches are
    correct to second order in the error of the pressure, at least to a fifth of g over the approach. The
    factors come from scans of pairs and hold for the scenes of `tests/linear_bem/test_errors.py`.
    """
    values = quantities(contacts)
    if isinstance(contacts, GridContacts):
        c = contacts.coarseness
        peak = np.maximum(max(c, edge_peak(contacts)), narrow_peaks(contacts))
        force = 0.5 * c**2 + contacts.edge_shares
        own: dict[str, Array | float] = {"normal_force": force, "approach": force}
        own |= {"peak_pressure": peak, "contact_area": 0.5 * c}
        return _at_prescribed_load(contacts, {name: own[name] * np.abs(v) for name, v in values.items()})
    gap = contacts.gap_in_contact
    radius = np.sqrt(np.maximum(contacts.contact_areas, 1e-300) / np.pi)
    degree = contacts.zones.degree
    depth = gap * deepest(contacts.approaches)
    peak = 4.0 * degree / radius * depth / (2.0 * np.pi * contacts.kernel.singular)
    share = peak / np.where(values["peak_pressure"] > 0.0, values["peak_pressure"], math.inf)
    force = np.maximum(0.2 * gap, _light_shares(contacts))
    shares = {"normal_force": force, "approach": 0.2 * gap, "peak_pressure": share, "contact_area": share}
    least = least_share(contacts) + 3.0 * contacts.smooth.residual
    return _at_prescribed_load(contacts, {name: (shares[name] + least) * np.abs(v) for name, v in values.items()})


def edge_peak(contacts: GridContacts) -> float:
    """Return the relative error of a peak pressure at the edge of the contact with a film stiffer than its base.

    The peak is about as wide as the film is thick, h: cells of side d miss it by (d/h)^2/2, at most 0.15. Measured at
    E1/E2 = 30 and 100, h = 0.05 R: 0.070 at d/h = 0.39, 0.056 at 0.44, 0.004 at 0.2; two grids may have equal errors.
    """
    if contacts.kernel.homogeneous or contacts.kernel.far_ratio <= 1.0:
        return 0.0
    return float(min(0.5 * (contacts.resolution / contacts.kernel.thickness) ** 2, 0.15))


def narrow_peaks(contacts: GridContacts) -> Array:
    """Return the relative errors of peak pressures at rounded tips and edges that are hardly wider than a cell d.

    Under a cone of slope s the pressure rises as (E* s/2) ln(2 a/r) down to the width of its tip, s times the tip's
    radius. At a punch's edge it rises with the root of the distance, down to the width (3 D e/(2 sqrt(2 a)))^(2/3) of
    the contact with the rounding of radius e, D = Q/(2 E* a) (half-space of the layer's material; Johnson 1985, Contact
    Mechanics, sections 5.1 and 5.4).
    """
    shares, peaks = np.zeros(contacts.problem.size), contacts.peak_pressures
    for i in np.flatnonzero(peaks > 0.0):
        body = contacts.problem.balls[i].indenter
        if isinstance(body, Cone):
            slope = math.tan(body.slope)
            lost = 0.25 * slope * math.log1p((contacts.resolution / (slope * body.tip_radius)) ** 2)
            shares[i] = lost / (math.pi * contacts.kernel.singular * peaks[i])
        elif isinstance(body, Punch):
            depth = 0.5 * math.pi * contacts.kernel.singular * contacts.normal_forces[i] / body.radius
            width = 1.5 * depth * body.edge_radius / math.sqrt(2.0 * body.radius)
            shares[i] = (1.0 + (contacts.resolution / width ** (2.0 / 3.0)) ** 2) ** 0.25 - 1.0
    return shares


def errors_by_change(before: Contacts, after: Contacts, previous: Errors | None = None) -> Errors:
    """Return error estimates from the last refinement; ``previous`` are the estimates of the refinement before.

    With polynomials, the change itself. On grids, which converge unevenly, twice the change or half of the previous
    estimate, whichever is larger, plus `_on_one_grid`.
    """
    old, new = quantities(before), quantities(after)
    errors = {name: np.abs(new[name] - old[name]) + least_share(after) * np.abs(new[name]) for name in new}
    if isinstance(after, GridContacts) and isinstance(before, GridContacts):
        known, left = _on_one_grid(before), _on_one_grid(after)
        for name, error in errors.items():
            kept = 0.5 * (previous[name] - known[name]) if previous else 0.0
            error[:] = np.maximum(2.0 * error, kept) + left[name]
    elif isinstance(after, SmoothContacts):
        errors = {name: error + 3.0 * after.smooth.residual * np.abs(new[name]) for name, error in errors.items()}
    return _at_prescribed_load(after, errors)


def _on_one_grid(contacts: GridContacts) -> Errors:
    """Return errors that two grids may share: of order (cell/contact radius)^2, and from the position of the edge."""
    values = quantities(contacts)
    errors = {k: (0.1 * contacts.coarseness**2 + contacts.edge_shares) * np.abs(v) for k, v in values.items()}
    errors["contact_area"] = contacts.area_errors
    peak = np.maximum(edge_peak(contacts), narrow_peaks(contacts))
    errors["peak_pressure"] = np.maximum(errors["peak_pressure"], peak * values["peak_pressure"])
    return errors


def _at_prescribed_load(contacts: Contacts, errors: Errors) -> Errors:
    """Return the errors with those of prescribed quantities set: 0 for approaches, the unmet part for forces."""
    load, touching = contacts.problem.load, contacts.normal_forces > 0.0
    if isinstance(contacts, SmoothContacts):
        bodies = {id(b.shape): b.shape for b in contacts.problem.balls if isinstance(b.shape, Indenter)}
        kinked = [place for place, body in bodies.items() if has_kinks(body)]
        factor = np.where([id(b.shape) in kinked for b in contacts.problem.balls], KINK, 1.0)
        errors = {name: error * factor for name, error in errors.items()}
    if load.kind == "approach":
        errors["approach"] = np.zeros(contacts.problem.size)
    else:
        # the surface under a ball without load is as accurate as the approach of the deepest ball
        errors["approach"] = np.where(touching, errors["approach"], np.max(errors["approach"][touching]))
    if load.kind == "force":
        errors["normal_force"] = np.abs(contacts.normal_forces - np.array(load.values))
    return {name: np.where(touching | (name == "approach"), error, 0.0) for name, error in errors.items()}


def missed_pulls(contacts: GridContacts) -> Array:
    """Return T [N] on every ball from contacts smaller than a grid cell, which the grid misses; forces by Hertz."""
    problem, forces = contacts.problem, contacts.normal_forces.copy()
    for i, (depth, _) in overlapping(contacts).items():
        forces[i] = 4.0 / 3.0 * math.sqrt(problem.balls[i].radius * depth**3) / (math.pi * contacts.kernel.singular)
    return np.asarray(half_space_pulls(contacts.kernel, problem.positions, forces) - pulls(contacts))
