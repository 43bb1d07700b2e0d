# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the physics engine, with the reasons for their values."""

from __future__ import annotations

from dataclasses import dataclass

from modular_framework_simulation.errors import SimulationError

MIN_STEP_NS = 100_000
MAX_STEP_NS = 10_000_000


@dataclass(frozen=True, slots=True)
class PhysicsSettings:
    """Settings of the physics engine.

    Attributes:
        time_step_ns: Duration of a physics step [ns]; an integer, so that simulated time does not drift. The laws of
            physics are tested from 1 ms to 1/240 s, and grasps with 2 ms; five steps make one tick of a 100 Hz clock.
            Motion errors grow with the step (a fall of t seconds ends g t step / 2 too low), as does the creep of held
            objects.
        solver_iterations: Maximum number of iterations of the contact solver, which stops early after convergence. A
            grasped object is part of a chain arm - finger - object - finger, through which forces propagate link by
            link. PyBullet uses more iterations if the masses of free bodies differ by more than 1:75.
        contact_erp: Fraction of a penetration that is corrected in one step. A falling object penetrates by up to one
            step of motion at the impact, and rebounds with up to this fraction of its velocity, so the value is low.
        friction_erp: Fraction of a slip that is corrected in one step of sticking friction. Friction without correction
            only stops the velocity, and the solver's errors accumulate. Contacts of fingers therefore have friction
            anchors, to which they are drawn back while the force is within the friction cone. The engine also keeps the
            normal of an anchor, so the engine renews the anchors in a rotating gripper occasionally.
        contact_reach: Maximum distance of surfaces that may touch in the next step, and of two contacts that are
            merged, as a fraction of the smaller body's radius. The engine's default of 0.02 merges contacts of a
            shaking cube in the gripper, which creeps four times as far as with this value.
        bounce_threshold: Minimum impact velocity of a bounce [m/s]. Gravity adds 0.02 m/s in a step of 2 ms; below
            about twice this value, objects at rest would bounce forever.
        bounce_erp: Value of contact_erp for bouncing surfaces; the correction in the step of the impact adds up to this
            fraction of the impact velocity to the velocity after the impact.
        hardest_erp: Maximum value of contact_erp that a stiffness in a model may require.
        body_spinning_friction: Default resistance of objects against spinning about a contact normal [m]; none, as in
            Gazebo.
        body_rolling_friction: Default resistance of objects against rolling [m]; none, as in Gazebo.
        body_friction: Default friction coefficient of robot links.
        pad_friction: Default friction coefficient of gripper links (rubber pads). A contact uses the smaller
            coefficient of its two surfaces.
        pad_spinning_friction: Resistance of gripper links against spinning [m]; soft pads touch over an area.
        pad_rolling_friction: Resistance of gripper links against rolling [m].
        rest_speed: Maximum velocity of sleeping objects and their joints [m/s, rad/s]. An object that was slower for
            two seconds is not computed until a moving body touches it, a force acts on it, or a request changes the
            world; 0 disables sleeping. Most objects of a world are at rest, and each costs 15 us per step. The solver
            leaves objects at rest with up to 0.002 rad/s; a starting slip exceeds the value within two seconds, if
            ever. Only PyBullet supports sleeping objects.
    """

    time_step_ns: int = 2_000_000
    solver_iterations: int = 150
    contact_erp: float = 0.05
    friction_erp: float = 0.8
    contact_reach: float = 0.005
    bounce_threshold: float = 0.05
    bounce_erp: float = 0.01
    hardest_erp: float = 0.2
    body_spinning_friction: float = 0.0
    body_rolling_friction: float = 0.0
    body_friction: float = 1.0
    pad_friction: float = 1.0
    pad_spinning_friction: float = 0.005
    pad_rolling_friction: float = 0.0005
    rest_speed: float = 0.003

    def __post_init__(self) -> None:
        if not MIN_STEP_NS <= self.time_step_ns <= MAX_STEP_NS:
            raise SimulationError(
                f"time step of the physics: got {self.time_step_s:g} s; allowed: {MIN_STEP_NS * 1e-9:g} s to "
                f"{MAX_STEP_NS * 1e-9:g} s"
            )

    @property
    def time_step_s(self) -> float:
        """Returns the duration of a physics step [s]."""
        return self.time_step_ns * 1e-9
