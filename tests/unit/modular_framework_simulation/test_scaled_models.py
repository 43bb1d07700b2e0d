# SPDX-License-Identifier: BSD-3-Clause
"""A model of another size has the same density and shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.model_extents import bounding_box
from modular_framework_simulation.models.model_variants import scaled_model
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources, no_packages

MODELS = Path(__file__).parents[3] / "src" / "modular_framework_description" / "models"


def text_of(name: str) -> str:
    return (MODELS / name / "model.sdf").read_text()


def read(text: str):
    return read_model_text(text, "model.sdf", Resources((MODELS,), no_packages))


@pytest.mark.parametrize("factor", [0.6, 1.0, 1.2])
def test_a_cube_has_the_mass_and_the_inertia_of_its_edge(factor: float) -> None:
    edge_m, density = 0.05 * factor, 0.1 / 0.05**3
    (link,) = read(scaled_model(text_of("cube"), factor, "cube")).links
    assert link.collisions[0].geometry.size == pytest.approx((edge_m,) * 3)
    assert link.visuals[0].geometry.size == pytest.approx((edge_m,) * 3)
    assert link.inertial.mass == pytest.approx(density * edge_m**3)
    moment = density * edge_m**5 / 6  # of a cube about its centre
    assert np.allclose(link.inertial.inertia, [moment, 0.0, 0.0, moment, 0.0, moment], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("name", ["can", "ball", "l_bracket", "mug", "mustard_bottle"])
def test_every_length_is_multiplied(name: str) -> None:
    before, after = (
        np.array(bounding_box(read(text))) for text in (text_of(name), scaled_model(text_of(name), 1.5, name))
    )
    assert np.allclose(after, 1.5 * before, atol=1e-9)


def test_a_model_with_a_joint_is_refused() -> None:
    joint = '<joint name="j" type="fixed"><parent>link</parent><child>link</child></joint></model>'
    with pytest.raises(DescriptionError, match="got a <joint>; allowed in a model with a size: links and shapes alone"):
        scaled_model(text_of("cube").replace("</model>", joint), 2.0, "cube")
    with pytest.raises(DescriptionError, match="cube:1: not an XML document"):
        scaled_model("no model", 2.0, "cube")
