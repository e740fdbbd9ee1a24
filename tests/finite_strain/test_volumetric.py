"""Choice of the element form and its refusals, without DOLFINx."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import finite_strain
from finite_strain.mechanics.volumetric import (
    VOLUME_STIFFNESS,
    Compressible,
    Mixed,
    describe_forms,
    form_notes,
    volume_stiffness,
)
from finite_strain.planning.run_plan import plan_run
from linear_bem import Elastic, InvalidProblem, Layer, Problem, UnsupportedProblem
from tests.finite_strain.scenes import STIFF_SUBSTRATE, in_form, pair, relatively


def of(poisson: float, substrate: Elastic | None = None) -> Problem:
    return pair(0.1, poisson=poisson, substrate=substrate)


@pytest.mark.parametrize(
    ("poisson", "form"),
    [(nu, "displacement") for nu in (0.0, 0.3, 0.48, 0.4899)] + [(nu, "mixed") for nu in (0.49, 0.4999, 0.5)],
)
def test_the_form_follows_from_poissons_ratio(poisson: float, form: str) -> None:
    assert finite_strain.plan(of(poisson))["forms"] == {"layer": form}


def test_layer_and_substrate_choose_independently() -> None:
    assert describe_forms(of(0.5, STIFF_SUBSTRATE)) == {"layer": "mixed", "substrate": "displacement"}
    assert describe_forms(of(0.3, Elastic(10.0, 0.5))) == {"layer": "displacement", "substrate": "mixed"}


@pytest.mark.parametrize("poisson", [0.4, 0.48, 0.4999])
def test_a_scene_may_name_the_form_where_both_are_valid(poisson: float) -> None:
    for form in ("displacement", "mixed"):
        asked = in_form(form, of(poisson, STIFF_SUBSTRATE))
        assert finite_strain.plan(asked)["forms"] == {"layer": form, "substrate": "displacement"}
        assert form_notes(asked) == [f"layer: {form} form of the elements, as [elements] asks"]


def test_a_note_names_the_choice_unless_it_is_the_displacement_form() -> None:
    assert form_notes(of(0.3, STIFF_SUBSTRATE)) == []
    (note,) = form_notes(of(0.4999, STIFF_SUBSTRATE))
    assert note.startswith("layer: mixed")
    assert "0.4999" in note


@pytest.mark.parametrize(
    ("form", "poisson", "remedy"),
    [
        ("displacement", 0.49991, "mixed"),
        ("displacement", 0.5, "mixed"),
        ("mixed", 0.399, "displacement"),
        ("mixed", 0.0, "displacement"),
    ],
)
def test_a_form_that_does_not_fit_is_refused_with_its_remedy(form: str, poisson: float, remedy: str) -> None:
    with pytest.raises(UnsupportedProblem, match=rf'elements\.form: .*got {poisson:g}; use "{remedy}"'):
        plan_run(in_form(form, of(poisson)), 0.02, "finite_strain")


def test_an_unknown_form_is_refused() -> None:
    with pytest.raises(InvalidProblem, match=r'elements\.form: must be "displacement" or "mixed", got "both"'):
        in_form("both", of(0.48))


@pytest.mark.parametrize("stiffness", [0.0, volume_stiffness(0.8, 3.1), volume_stiffness(1e9, 3.1)])
def test_the_mixed_energy_is_stationary_and_equal_at_the_pressure_of_the_displacement_form(stiffness: float) -> None:
    lame, j = 3.1, -0.04
    at = [Mixed(lame * j + step, 1.0 / lame, stiffness)(j) for step in (-1e-4, 0.0, 1e-4)]
    assert at[1] == relatively(Compressible(lame)(j), 1e-14)  # roundoff
    assert max(at[0], at[2]) < at[1]  # a maximum in the pressure: equilibrium is a saddle point
    assert at[2] - at[0] == pytest.approx(0.0, abs=1e-15)


def test_no_lame_constant_is_needed_where_it_is_infinite() -> None:
    layer = Layer(1.0, 0.5, 1.0)
    assert math.isinf(layer.lame_first)
    assert Mixed(2.0, 1.0 / layer.lame_first, 0.0)(0.1) == 0.2
    assert volume_stiffness(layer.shear_modulus, layer.lame_first) == VOLUME_STIFFNESS * layer.shear_modulus
    assert describe_forms(replace(of(0.3), layer=layer)) == {"layer": "mixed"}
