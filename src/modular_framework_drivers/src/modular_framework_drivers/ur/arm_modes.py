# SPDX-License-Identifier: BSD-3-Clause
"""Determines the fault of a UR arm from the modes of its controller."""

from __future__ import annotations

from modular_framework_drivers.ur.arm_messages import ArmState

PROGRAM_STOPPED, PROGRAM_PLAYING = 1, 2
_SAFETY_NORMAL, _SAFETY_REDUCED, _ROBOT_RUNNING = 1, 2, 7
_SAFETY_MODES = {
    3: "protective stop",
    4: "recovery mode",
    5: "safeguard stop",
    6: "emergency stop (system)",
    7: "emergency stop",
    8: "safety violation",
    9: "safety fault",
    10: "joint identification",
    11: "undefined safety mode",
}
_ROBOT_MODES = {
    -1: "has no controller",
    0: "is disconnected",
    1: "waits for a confirmation of its safety settings",
    2: "is booting",
    3: "has no power",
    4: "is being powered",
    5: "has its brakes closed",
    6: "is in backdrive mode",
    8: "updates its firmware",
}
_POWER = "call dashboard/power_on and dashboard/brake_release"
_REMEDIES = {
    3: "find its cause and call dashboard/unlock_protective_stop",
    6: f"release it and {_POWER}",
    7: f"release it and {_POWER}",
    8: "call dashboard/restart_safety",
    9: "call dashboard/restart_safety",
}


def robot_fault(state: ArmState, address: str) -> str:
    """Returns the fault that prevents motion in this state and its remedy; "" if there is none."""
    mode = state.safety_mode
    if mode not in (_SAFETY_NORMAL, _SAFETY_REDUCED):
        name, remedy = _SAFETY_MODES.get(mode, f"safety mode {mode}"), _REMEDIES.get(mode, "look at its pendant")
        return f"{name} of the arm at {address}; {remedy}, then call resume"
    if state.robot_mode != _ROBOT_RUNNING:
        name = _ROBOT_MODES.get(state.robot_mode, f"is in robot mode {state.robot_mode}")
        return f"the arm at {address} {name}; {_POWER}, then resume"
    return ""
