# SPDX-License-Identifier: BSD-3-Clause
"""Perturbations of an episode: axes along which the simulated world differs from its nominal state.

The simulated world applies a perturbation; the methods receive no information about it. The names of the fields of
`Perturbation` are the names of the axes in experiment files, databases and records.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

PERTURBATION = "perturbation"
"""Name of the factor whose levels are the perturbations of an experiment."""
NOMINAL = "nominal"
"""Label of the level without perturbation."""
FACTOR = "factor"
"""Unit of an axis that multiplies a property of the world."""
ONE_AT_A_TIME, LATIN_HYPERCUBE, SOBOL = "one_at_a_time", "latin_hypercube", "sobol"
DESIGNS = (ONE_AT_A_TIME, LATIN_HYPERCUBE, SOBOL)
_LENGTH = {"m": 1.0, "mm": 0.001}


@dataclass(frozen=True, slots=True, kw_only=True)
class PerturbationAxis:
    """A property of the world that an experiment can perturb.

    Attributes:
        name: Name of the axis.
        units: Allowed units, with their value in SI units.
        nominal: Nominal value in SI units.
        low: Smallest allowed value in SI units.
        high: Largest allowed value in SI units.
        description: Description of the effect on the world.
    """

    name: str
    units: Mapping[str, float]
    nominal: float
    low: float
    high: float
    description: str


_AXES = (
    PerturbationAxis(
        name="object_mass",
        units={FACTOR: 1.0},
        nominal=1.0,
        low=0.01,
        high=100.0,
        description="Factor of masses and moments of inertia of the objects.",
    ),
    PerturbationAxis(
        name="object_friction",
        units={FACTOR: 1.0},
        nominal=1.0,
        low=0.001,
        high=10.0,
        description="Factor of the friction coefficients of the objects. A contact has the smaller coefficient of both "
        "surfaces.",
    ),
    PerturbationAxis(
        name="object_size",
        units={FACTOR: 1.0},
        nominal=1.0,
        low=0.2,
        high=5.0,
        description="Factor of all lengths of the objects at constant density. The planning scene shows the true size.",
    ),
    PerturbationAxis(
        name="object_centre_of_mass",
        units=_LENGTH,
        nominal=0.0,
        low=0.0,
        high=0.2,
        description="Distance between the centre of mass of each object and its nominal place, along the object's x "
        "axis.",
    ),
    PerturbationAxis(
        name="perceived_pose_error",
        units=_LENGTH,
        nominal=0.0,
        low=0.0,
        high=0.2,
        description="Horizontal distance between the true position of each object and its position in the planning "
        "scene. The direction of each object is drawn from the seed.",
    ),
)
AXES: Mapping[str, PerturbationAxis] = {axis.name: axis for axis in _AXES}
"""All axes, by name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Perturbation:
    """Value of each axis in an episode, in SI units; `AXES` describes the axes."""

    object_mass: float = 1.0
    object_friction: float = 1.0
    object_size: float = 1.0
    object_centre_of_mass: float = 0.0
    perceived_pose_error: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectPerturbation:
    """Perturbation of one object besides its scale, as the world applies it.

    Attributes:
        mass: Factor of masses and moments of inertia.
        friction: Factor of the friction coefficients.
        centre_of_mass: Distance by which the centre of mass moves along the object's x axis [m].
        pose_error: Perceived minus true position in the world frame, x and y [m].
    """

    mass: float = 1.0
    friction: float = 1.0
    centre_of_mass: float = 0.0
    pose_error: tuple[float, ...] = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class PerturbedLevel:
    """A level of the factor `PERTURBATION`.

    Attributes:
        label: Label of the level, such as `perceived_pose_error=10 mm`.
        values: Value of each perturbed axis, in the units of the experiment file.
    """

    label: str
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class PerturbedAxis:
    """An axis that an experiment perturbs.

    Attributes:
        name: Name of the axis.
        unit: Unit of the values in the experiment file.
        nominal: Nominal value in this unit.
    """

    name: str
    unit: str
    nominal: float


@dataclass(frozen=True, slots=True)
class Perturbations:
    """Perturbations of an experiment.

    Attributes:
        axes: Perturbed axes.
        levels: Levels, the nominal level first.
        design: Name of the design: `one_at_a_time`, `latin_hypercube` or `sobol`.
        wanted_success: Success rate below which a method fails, from 0 to 1.
    """

    axes: tuple[PerturbedAxis, ...]
    levels: tuple[PerturbedLevel, ...]
    design: str
    wanted_success: float

    @property
    def one_at_a_time(self) -> bool:
        """Returns whether each level perturbs one axis only."""
        return self.design == ONE_AT_A_TIME
