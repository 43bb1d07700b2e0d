# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the physics engine, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass

from modular_framework_simulation.errors import SimulationError

SHORTEST_STEP_NS = 100_000
LONGEST_STEP_NS = 10_000_000


@dataclass(frozen=True, slots=True)
class PhysicsSettings:
    """Settings of the physics engine.

    Attributes:
        time_step_ns: One physics step [ns]; an integer, so that simulated time never drifts. The laws of physics are
            tested from 1 ms to 1/240 s, grasps with 2 ms: five steps make one tick of a 100 Hz clock. Errors of motion
            grow with the step (a fall of t seconds ends g t step / 2 too low), so does the creep of held objects.
        solver_iterations: Of the contact solver, at most; it ends earlier where nothing changes any more. A grasped
            object hangs in a chain arm - finger - object - finger, through which forces travel link by link. PyBullet
            makes more of them where the masses of free bodies differ more than 1:75.
        contact_erp: Share of a penetration that is corrected in one step. An object that falls is up to one step too
            deep when it touches, and leaves with up to this share of its velocity; low, so that it does not jump.
        friction_erp: Share of a slip that is taken back in one step where surfaces stick. Friction alone only stops
            the velocity, and what the solver leaves of it adds up. Touches on fingers therefore remember where they
            began (friction anchors of the engine), and are drawn back there while the force is within the friction
            cone. The engine keeps the normal of such a touch, too: in a hand that turns, it begins again now and then.
        contact_reach: How near surfaces are that may touch in the coming step, and how near two touches of the same
            surfaces are that count as one, as a share of the smaller body's radius. The engine's 0.02 joins touches
            that a cube in the hand makes at different places while it shakes: it creeps four times as far as with this.
        bounce_threshold: Impacts that are slower do not bounce [m/s]. Gravity adds 0.02 m/s in a step of 2 ms: below
            about twice that, objects at rest would hop for ever.
        bounce_erp: As contact_erp, for surfaces that bounce: what is corrected in the step of the impact adds to the
            velocity afterwards, up to this share of the velocity before.
        hardest_erp: As contact_erp, the most that a stiffness in a model may ask for.
        body_spinning_friction: Resistance of objects against spinning about a contact normal [m], where the
            model does not say: none, as in Gazebo.
        body_rolling_friction: Resistance of objects against rolling [m], where the model does not say: none.
        body_friction: Coefficient of friction of links of robots whose description does not say.
        pad_friction: Of the gripper's links (rubber pads) whose description does not say. The smaller coefficient of
            the two surfaces of a contact counts.
        pad_spinning_friction: Of the gripper's links [m]; soft pads touch over an area.
        pad_rolling_friction: Of the gripper's links [m].
        rest_speed: An object without joints that was slower for two seconds [m/s, rad/s] is not computed until what
            moves touches it, a force acts on it, or a request changes the world; 0: always. Most objects of a world
            lie still, and each costs 15 us a step. What the solver leaves of the velocity of objects at rest is up to
            0.002 rad/s; a slip that begins is faster than this within two seconds if it ever is. PyBullet alone.
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
        if not SHORTEST_STEP_NS <= self.time_step_ns <= LONGEST_STEP_NS:
            raise SimulationError(
                f"time step of the physics: got {self.time_step_s:g} s; allowed: {SHORTEST_STEP_NS * 1e-9:g} s to "
                f"{LONGEST_STEP_NS * 1e-9:g} s"
            )

    @property
    def time_step_s(self) -> float:
        """One physics step [s]."""
        return self.time_step_ns * 1e-9
