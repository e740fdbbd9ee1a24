"""The published results: what each states, where it was read, and which could not be read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """A published result: ``read`` is the address where ``states`` was read; ``remark`` says what is wrong or open."""

    citation: str
    doi: str
    states: str
    read: str
    remark: str = ""


ATOMICJ = "github.com/pawelHerm/AtomicJ (d0117b2), analysis/indentation/"
PYFMRHEO = "github.com/jlopezalo/PyFMRheo (21fad3c), src/pyfmrheo/models/bec.py"
NIMS = "github.com/DavidMercier/NIMS (054ba40), doc/models_thin_films.rst"
OWN_EQUATION = "The code names the method and cites no paper; it states no error of its fits."
SOURCES = {
    "hertz": Source(
        "Code_Aster validation manual V6.04.104, SSNV104, contact of two spheres, after Hertz 1881",
        "",
        "eq. 2.1-1 and 2.1-2: R = 50 mm, E = 20 GPa, nu = 0.3, each pressed in by 2 mm: p0 = 2798.3 MPa, a = 10 mm",
        "docaster-en-codeaster-doc (gitlab.io), man_v/v6/v6.04.104, pages 1 and 2",
    ),
    "sneddon": Source(
        "Sneddon 1965",
        "10.1016/0020-7225(65)90019-4",
        "force and approach of a sphere on a half-space in closed form",
        "github.com/AFM-analysis/nanite, nanite/model/model_sneddon_spherical.pyx, docstring",
    ),
    "kontomaris": Source(
        "Kontomaris 2021",
        "10.1088/1361-6404/abccfb",
        "eq. 17: the same force as six powers of D / R",
        PYFMRHEO,
        "Its first coefficient, 1.01, is 1 % above Hertz's limit.",
    ),
    "galin": Source(
        "Galin: body of height A r^n",
        "",
        "force on a half-space in closed form",
        f"{ATOMICJ}HertzianPowerShaped.java",
    ),
    "hyperboloid": Source(
        "Sun, Akhremitchev and Walker: hyperboloid",
        "",
        "force on a half-space in closed form; without adhesion",
        f"{ATOMICJ}HertzianHyperboloid.java",
        "The code names the shape; the paper is named by its neighbour, SunAkhremitchevWalkerIndentation.java.",
    ),
    "lebedev": Source(
        "Lebedev and Ufliand's integral equation, bonded layer, paraboloid, nu = 0.5",
        "",
        "two polynomials fitted to its solution; their last term is the thin-layer law pi/2 (R D / h^2)^3",
        f"{ATOMICJ}ReducedLoadVsReducedIndentationApproximationThinBondedIncompressibleLayer.java",
        OWN_EQUATION,
    ),
    "punch": Source(
        "Lebedev and Ufliand's integral equation, bonded layer, flat punch, nu = 0 and 0.5",
        "",
        "polynomials in a / h fitted to its solution",
        f"{ATOMICJ}XiApproximationBonded(IdeallyCompressible, Incompressible)Layer.java",
        OWN_EQUATION,
    ),
    "garcia": Source(
        "Garcia and Garcia 2018",
        "PII S0006-3495(18)30590-3",
        "coefficients of chi^1 to chi^4 (paraboloid) and of a / h (flat punch), bonded layer, nu = 0.5",
        PYFMRHEO,
        "A series in chi: it cannot hold far beyond chi = 0.5, and states no range there.",
    ),
    "dimitriadis": Source(
        "Dimitriadis et al. 2002",
        "PMC1302067",
        "eq. 12: coefficients of chi^1 to chi^4 for nu = 0.5; and for any nu",
        f"{PYFMRHEO}; {ATOMICJ}HertzianThinSampleParaboloidChadwick.java",
        "Its chi^2 lacks what Garcia and Garcia have, and its two forms differ in the sign of chi^4 at nu = 0.5. The "
        "second route, Lebedev and Ufliand's equation, is on our side.",
    ),
    "carbone": Source(
        "Carbone and Mangialardi 2008",
        "10.1016/j.jmps.2007.05.009",
        "eq. A.30: response of a bonded layer to a harmonic pressure",
        "github.com/ContactEngineering/ContactMechanics (40ad18e), ContactMechanics/FFTElasticHalfSpace.py",
        "T from it takes Hertz's pressure; its error is what a uniform pressure changes.",
    ),
    "gao": Source(
        "Gao et al. 1992: coated half-space, flat punch",
        "10.1016/0020-7683(92)90004-D",
        "weight of the coating's modulus, of first order in the contrast of the moduli",
        f"{NIMS}, eq. phi_gao_0",
        "Compared at first order, which is what it claims: half the difference of coatings 5 % stiffer and softer. "
        "(The page prints the composite Poisson's ratio with a wrong sign; at equal ratios it is not needed.)",
    ),
    "perriot": Source(
        "Perriot and Barthel 2004: coated half-space",
        "10.1557/jmr.2004.19.2.600",
        "fit of the effective modulus; its power n is left between 1.06 and 1.32",
        f"{NIMS}, eq. perriot_barthel; matlab_code/elastic_models/model_perriot_barthel.m for n",
        "What it says is the range between both n. On soft substrates and stiff coatings the truth lies outside it: k0 "
        "is a fit over four decades.",
    ),
    "long": Source(
        "Long, Hall, Wu and Hui 2011",
        "10.1016/j.bpj.2011.06.049",
        "fit of finite-element solutions, neo-Hookean, bonded; 0.3 <= R / h <= 12.7, D / h <= min(0.6, R / h)",
        "range: abstract, pubmed.ncbi.nlm.nih.gov/21806932; formula: a public MATLAB script (id 14052363270 in the "
        "index of public code, which does not name its repository)",
        "A second public code (textureAnalyzerGels on rdrr.io) prints 1.5 for 1.15; the limit of no load (Lebedev and "
        "Ufliand: 1.13) decides for 1.15. The abstract states no error of the fit. Its two sets of "
        "coefficients do not meet at R / h = 2; there we lie between both (second route).",
    ),
    "lin": Source(
        "Lin, Shreiber, Dimitriadis and Horkay 2009: Ogden half-space",
        "10.1007/s10237-008-0139-9",
        "force by an equivalent uniaxial strain 0.2 a / R, exponent 2 (neo-Hookean)",
        f"{ATOMICJ}OgdenIndentation.java; attributed in table 1 of PMC9922104",
        "It stiffens at any depth; finite elements, ours and those of Long et al., soften. Not usable for forces.",
    ),
    "shojaeifard": Source(
        "Shojaeifard and Bacca 2025",
        "10.1039/D5SM00502G",
        "F = 16/9 E sqrt(R) D^1.5 for D < 0.1 R, incompressible Ogden half-space",
        "abstract, pubs.rsc.org; its bound 0.1 R: abstract of the preprint, arxivlens.com",
        "It names a regime and no error: of what is missing at its end the exact sphere (Sneddon) takes a third off "
        "and finite strain the rest. Its coefficients of deep indentation are not in the abstract.",
    ),
    "karpitschka": Source(
        "Karpitschka et al. 2016: drops on gels",
        "arXiv 1601.07121",
        "drops attract on thick gels; on thin ones they repel at short range",
        "abstract, ar5iv.labs.arxiv.org/html/1601.07121",
        "Sign alone: a drop pushes inside its rim and pulls at it, a ball only pushes; far away they need not agree.",
    ),
}  # fmt: skip
NOT_OPENED = {
    "Zhang et al. 2014, 10.1007/s10237-013-0481-4": "named by others, its formula nowhere at hand",
    "Mu et al. 2025, arXiv 2506.11461 (up to D = 2.5 R)": "abstract only; no formula in it",
    "Du et al. 2022, arXiv 2209.05646 (second order)": "abstract only; no formula in it",
    "Hayes et al. 1972, J. Biomech. 5, 541 (kappa)": "abstract only; the same punch is compared by another fit",
    "Jaffar 1989, 10.1016/0020-7403(89)90113-4": "not found; its limit is the last term of Lebedev's fit",
    "arXiv 1703.06910 (stretched rubber)": "abstract only; our layer is not stretched",
    "Lubricants 2023, 11, 84 (coated half-space)": "introduction only; no number in it",
    "Hu et al. 2011 (spheres on gel layers)": "one code has it with mixed units in the argument; not usable",
}
"""What was looked for and could not be read, and why."""
