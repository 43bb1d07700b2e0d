# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the physics engine, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PhysicsSettings:
    """Settings of the physics engine.

    Attributes:
        time_step_ns: One physics step [ns]; an integer, so that simulated time never drifts. 2 ms keeps a grasp held by
            friction still (an object creeps by about 0.1 mm/s at most in the hand), and five steps make one tick of a
            100 Hz clock.
        solver_iterations: Of the contact solver. A grasped object hangs in a chain arm - finger - object - finger; with
            60 iterations the solver leaves a creep of 1 to 2 mm/s behind in that chain, with 150 a tenth of it.
        contact_erp: Share of a penetration that is corrected in one step; low, so that objects that fall or are
            spawned a little too deep do not jump.
        body_spinning_friction: Resistance of objects against spinning about a contact normal [m], where the
            model does not say; about the radius of a small contact patch.
        body_rolling_friction: Resistance of objects against rolling [m]; brings balls to rest on a table.
        pad_friction: Lateral friction of the gripper's links (rubber pads). The engine multiplies the coefficients of
            both sides of a contact.
        pad_spinning_friction: Of the gripper's links [m]; soft pads touch over an area.
        pad_rolling_friction: Of the gripper's links [m].
    """

    time_step_ns: int = 2_000_000
    solver_iterations: int = 150
    contact_erp: float = 0.1
    body_spinning_friction: float = 0.0005
    body_rolling_friction: float = 0.0001
    pad_friction: float = 1.2
    pad_spinning_friction: float = 0.005
    pad_rolling_friction: float = 0.0005

    @property
    def time_step_s(self) -> float:
        """One physics step [s]."""
        return self.time_step_ns * 1e-9
