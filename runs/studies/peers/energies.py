"""Independent implementation of the laws of `linear_bem.law`, as energies of C for automatic differentiation."""

from collections.abc import Callable
from typing import Any

from linear_bem.law import Gent, Hyperfoam, Law, MooneyRivlin, NeoHookean, Ogden, Yeoh


def energy(law: Law, shear: float, lame: float, math: Any) -> Callable[[Any], Any]:
    """Return the strain energy density psi(C), C = F^T F, by the formulas in the docstrings of `linear_bem.law`.

    ``math``: numpy, or a module with its functions that differentiates them. Raises `TypeError` for other laws.
    """

    def psi(C: Any) -> Any:
        J, I1 = math.sqrt(math.linalg.det(C)), math.trace(C)
        A, U = I1 - 3 - 2 * math.log(J), lame / 2 * (J - 1) ** 2
        if isinstance(law, NeoHookean):
            return shear / 2 * A + U
        if isinstance(law, MooneyRivlin):
            B, s = (I1**2 - math.trace(C @ C)) / 2 - 3 - 4 * math.log(J), law.share
            return shear / 2 * ((1 - s) * A + s * B) - s * shear * (J - 1) ** 2 + U
        if isinstance(law, Yeoh):
            c, d = law.ratios
            return shear / 2 * (A + c * A**2 + d * A**3) + U
        if isinstance(law, Ogden | Hyperfoam):
            squares, b = math.linalg.eigvalsh(C), lame / (2 * shear)
            total = 0 if isinstance(law, Hyperfoam) else U
            for a, w in zip(law.exponents, law.weights, strict=True):
                volume = (J ** (-a * b) - 1) / b if isinstance(law, Hyperfoam) else -a * math.log(J)
                total = total + 2 * shear * w / a**2 * (math.sum(squares ** (a / 2)) - 3 + volume)
            return total
        if not isinstance(law, Gent):
            raise TypeError(f"{law.name} is not implemented for peers: add its energy here")
        return -shear / 2 * law.limit * math.log(1 - A / law.limit) + U

    return psi
