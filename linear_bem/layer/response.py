r"""The response G(t) of a layered half-space to a pressure that varies like a cosine.

A pressure p cos(k x) on an elastic half-space (E, nu) displaces its surface down by
w = 2 (1 - nu^2) / (E k) p cos(k x). On a layer of thickness h bonded to another half-space the same
holds with the layer's constants and a factor G(t), t = k h, derived in linear_bem/README.md,

    G = [1 + 4 kap t e - lam kap e^2] / [(1 - lam e)(1 - kap e) - 4 kap t^2 e],   e = exp(-2 t),
    kap = (mu - 1) / (mu + 3 - 4 nu1),   lam = 1 - 4 (1 - nu1) / (1 + mu (3 - 4 nu2)),   mu = G1 / G2.

kap and lam are Dundurs-like contrasts: equal materials (both 0) give G = 1, a rigid base is mu = 0.
Sources: [Burmister 1945, J. Appl. Phys. 16, 89, doi 10.1063/1.1707558], [Chen and Engel 1972, Int. J. Solids Struct. 8,
1257, doi 10.1016/0020-7683(72)90079-0]; thin limits [Johnson 1985, Contact Mechanics, section 5.8].
"""

from functools import lru_cache

import numpy as np
from scipy.interpolate import PPoly, make_interp_spline

from linear_bem.arrays import Array
from linear_bem.errors import InvalidProblem
from linear_bem.problem import Elastic, Layer, SurfaceResponse

UNITY, SPAN = 1e-10, 15.0
"""Largest |G - 1| that counts as 0, and the t from which a layer's G is that close to 1."""
SMALL, ROUNDOFF = 0.1, 1e-9
"""Largest argument and largest |G| at which a response that is not positive is attributed to roundoff."""
JUMP, LITTLE, HALVINGS = 1e-4, 0.1, 40
"""Largest jump of a user's response, over the response or over the little value; halvings of an interval to find it."""
FIRST, LAST = 1e-6, 2.0**14
"""Range of arguments in which a user's response is sampled."""


class LayerResponse:
    """G(t) of one pair of materials; ``substrate`` None is a rigid base.

    ``expm1`` keeps the accuracy at small t for stiff and soft substrates
    (E1/E2 from 1e-6 to 1e6: relative error below 1e-12 wherever G > 1e-4).
    """

    def __init__(self, layer: Elastic, substrate: Elastic | None) -> None:
        nu = layer.poisson
        mu = 0.0 if substrate is None else layer.shear_modulus / substrate.shear_modulus
        below = 3.0 if substrate is None else 3.0 - 4.0 * substrate.poisson
        self._one_less_kap = 4.0 * (1.0 - nu) / (mu + 3.0 - 4.0 * nu)
        self._one_less_lam = 4.0 * (1.0 - nu) / (1.0 + mu * below)
        self._kap = (mu - 1.0) / (mu + 3.0 - 4.0 * nu)
        self._lam = 1.0 - self._one_less_lam
        # exactly 0 on a rigid base: cut-offs and the meaning of a mean displacement depend on this
        self._over_zero = 0.0 if substrate is None else self._one_less_lam + self._lam * self._one_less_kap

    def __call__(self, t: Array | float) -> Array:
        """Return G at t = k h >= 0."""
        t = np.asarray(t, dtype=float)
        kap, lam = self._kap, self._lam
        e = np.exp(-2.0 * t)
        rise = -np.expm1(-2.0 * t)
        numerator = self._over_zero - lam * kap * np.expm1(-4.0 * t) + 4.0 * kap * t * e
        denominator = (self._one_less_lam + lam * rise) * (self._one_less_kap + kap * rise) - 4.0 * kap * t * t * e
        return np.asarray(numerator / denominator)

    @property
    def at_zero(self) -> float:
        """G(0): the substrate's compliance over the layer's (0 on a rigid base)."""
        return self._over_zero / (self._one_less_lam * self._one_less_kap)

    @property
    def smallest_scale(self) -> float:
        """Argument t below which G changes by no more than about its own size; it limits tables."""
        contrast = min(self._one_less_lam, self._one_less_kap) / max(abs(self._kap), 1e-300)
        return float(min(1.0, max(contrast, 1e-9), max(self.at_zero, 1e-9)))


class MeasuredResponse:
    """G of a user's `SurfaceResponse`, sampled once: a quintic spline in log t, with its limits at both ends.

    Arguments are k times ``thickness`` [m], a length chosen so that G = 1 from `SPAN` on as for a homogeneous layer: it
    is the scale on which the kernel's smooth part varies. Raises `InvalidProblem` if G cannot be that of a surface.
    """

    def __init__(self, medium: SurfaceResponse) -> None:
        self._medium = medium
        end = 4.0
        while np.max(np.abs(self._asked(np.linspace(0.5, 1.0, 5) * end) - 1.0)) > UNITY:
            end *= 2.0
            if end > LAST:
                raise InvalidProblem(
                    f"layer.response: G(t) must tend to 1 exponentially, within {UNITY:g} at t = {LAST:g}, got G = "
                    f"{self._asked(np.array([LAST]))[0]:.6g} there; "
                    "young and poisson must be those at the surface; add a thin homogeneous skin to a medium that is "
                    "graded up to its surface"
                )
        log_t = np.linspace(np.log(FIRST), np.log(end), 200 * int(np.ceil(np.log(end / FIRST))))
        values = self._asked(np.exp(log_t))
        varies = np.flatnonzero(np.abs(values - 1.0) > UNITY)
        self.homogeneous = varies.size == 0
        last = float(np.exp(log_t[varies[-1]])) if varies.size else 1.0
        self._unit = last / SPAN
        self.thickness = medium.thickness / self._unit
        self._end = np.log(last)
        self._spline = PPoly.from_spline(make_interp_spline(log_t, values, k=5))
        self._require_no_jump(log_t, values)
        self._first, second = (float(v) for v in self._asked(np.array([FIRST, 2.0 * FIRST])))
        self._power = float(np.log2(second / self._first))
        self.at_zero = self._far_ratio(second)
        away = np.abs(values - self.at_zero) > 0.5 * self.at_zero
        scale = float(np.exp(log_t[np.argmax(away)])) if np.any(away) else 1.0
        self.smallest_scale = min(1.0, max(scale / self._unit, self.at_zero if np.any(away) else 1.0, 1e-9))
        if self.at_zero == 0.0:
            self.smallest_scale = 1e-9

    def _require_no_jump(self, log_t: Array, values: Array) -> None:
        """Raise `InvalidProblem` if G jumps where the spline misses it between samples.

        The interval of the largest change is halved: a kink's change vanishes with it, a jump's does not.
        """
        between = 0.5 * (log_t[1:] + log_t[:-1])
        off = np.abs(self._spline(between) - self._asked(np.exp(between)))
        missed = off > 0.1 * JUMP * np.maximum(values[1:], LITTLE)
        around = np.flatnonzero(np.convolve(missed, np.ones(5), "same") > 0.0)  # the spline oscillates beside a jump
        low, high, below, above = log_t[around], log_t[around + 1], values[around], values[around + 1]
        for _ in range(HALVINGS if around.size else 0):
            middle = 0.5 * (low + high)
            value = self._asked(np.exp(middle))
            left = np.abs(value - below) > np.abs(above - value)
            low, below = np.where(left, low, middle), np.where(left, below, value)
            high, above = np.where(left, middle, high), np.where(left, value, above)
        jumps = np.abs(above - below) / np.maximum(np.maximum(below, above), LITTLE)
        if around.size and np.max(jumps) > JUMP:
            k = int(np.argmax(jumps))
            raise InvalidProblem(
                f"layer.response: must be continuous, got {below[k]:.6g} below and {above[k]:.6g} above "
                f"{np.exp(high[k]):.6g}; join a table to its limits without a jump"
            )

    def _asked(self, t: Array) -> Array:
        """Return the user's G; raises `InvalidProblem` if it is not a positive number."""
        try:
            values = np.asarray(self._medium.response(t), dtype=float)
        except TypeError as error:
            raise InvalidProblem(f"layer.response: must take and return arrays, got {error}; use numpy") from error
        if values.shape != t.shape:
            raise InvalidProblem(
                f"layer.response: must return an array of shape {t.shape}, that of its argument, got {values.shape}"
            )
        bad = ~(np.isfinite(values) & (values > 0.0))
        if np.any(bad):
            at = t[bad]
            lost = np.max(at) < SMALL and np.all(np.abs(values[bad]) < ROUNDOFF)
            remedy = (
                "; the response of an incompressible bonded layer falls like the cube of its argument and is lost in "
                "roundoff there: return the leading term of its series, or take a Poisson's ratio of 0.4999"
            )
            raise InvalidProblem(
                f"layer.response: must return positive numbers, got {values[bad][-1]:.3g} at {at[-1]:.3g}: "
                f"not positive at {at.size} of {t.size} arguments between {np.min(at):.3g} and {np.max(at):.3g}"
                + (remedy if lost else "")
            )
        return values

    def _far_ratio(self, second: float) -> float:
        """Return G(0), stated or measured; 0 if G falls as a power of its argument."""
        stated = self._medium.far_ratio
        measured = 0.0 if self._power > 0.5 else 2.0 * self._first - second
        if stated is None:
            return max(measured, 0.0)
        if self._power > 0.5 and stated > self._first:
            raise InvalidProblem(
                f"layer.far_ratio: must be the limit of the response at 0, which falls to {self._first:.3g} at "
                f"{FIRST:g} and on, got {stated:g}; leave it out to have it measured"
            )
        if abs(self._power) < 1e-2 and abs(stated - measured) > 0.01 * measured:
            raise InvalidProblem(
                f"layer.far_ratio: must be the limit of the response at 0, which is {measured:.6g} at {FIRST:g}, got "
                f"{stated:g}; leave it out to have it measured"
            )
        return stated

    def __call__(self, t: Array | float) -> Array:
        """Return G at t = k times `thickness` >= 0."""
        asked = np.maximum(np.asarray(t, dtype=float) * self._unit, 1e-300)
        log_t = np.log(asked)
        inside = self._spline(np.clip(log_t, np.log(FIRST), self._end))
        power = self._power if self.at_zero == 0.0 else 1.0
        below = self.at_zero + (self._first - self.at_zero) * np.minimum(asked / FIRST, 1.0) ** power
        return np.asarray(np.where(log_t > self._end, 1.0, np.where(asked < FIRST, below, inside)))


@lru_cache(maxsize=64)
def response_of(layer: Layer, substrate: Elastic | None) -> LayerResponse | MeasuredResponse:
    """Return G of a layer on its base, or of a medium whose response is given."""
    return MeasuredResponse(layer) if isinstance(layer, SurfaceResponse) else LayerResponse(layer, substrate)


def scaled_media(layer: Layer, substrate: Elastic | None) -> tuple[Layer, Elastic | None]:
    """Return media with the same response, with E1 = h = 1; those alike but for roundoff then share one table."""
    if isinstance(layer, SurfaceResponse):
        return layer, None
    base = None if substrate is None else Elastic(float(f"{substrate.young / layer.young:.13g}"), substrate.poisson)
    return Layer(1.0, layer.poisson, 1.0), base
