# SPDX-License-Identifier: BSD-3-Clause
"""PID control of one joint, with gains from the parameters `gains/<joint>` or `pid`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names, read_bool, read_number


@dataclass(frozen=True, slots=True)
class PidGains:
    """PID gains under the names of control_toolbox.

    Attributes:
        p: Proportional gain.
        i: Integral gain [1/s].
        d: Derivative gain [s].
        i_clamp_min: Lower bound of the integral term, at most 0.
        i_clamp_max: Upper bound of the integral term, at least 0.
        antiwindup: Whether the integrated error itself is bounded, instead of only the integral term.
    """

    p: float
    i: float = 0.0
    d: float = 0.0
    i_clamp_min: float = 0.0
    i_clamp_max: float = 0.0
    antiwindup: bool = False


class Pid:
    """A PID with a bounded integral term.

    Args:
        gains: Initial gains.

    Attributes:
        gains: Gains in use; any thread may replace them at any time, without a jump of the integral term.
    """

    __slots__ = ("gains", "_gains", "_sum")

    def __init__(self, gains: PidGains) -> None:
        self.gains = self._gains = gains
        self._sum = 0.0

    def reset(self) -> None:
        """Clears the integrated error."""
        self._sum = 0.0

    def command(self, error: float, error_rate: float, period_s: float) -> float:
        """Computes the command.

        Args:
            error: Desired minus measured value.
            error_rate: Derivative of the error.
            period_s: Time since the last call.

        Returns:
            p * error + i * sum(error * period), bounded, + d * error_rate; 0 for an error that is not finite.
        """
        if self.gains is not self._gains:
            self._change_gains()
        gains = self._gains
        if not (math.isfinite(error) and math.isfinite(error_rate)):
            return 0.0
        total = self._sum + error * max(0.0, period_s)
        if gains.antiwindup and gains.i != 0.0:
            bounds = sorted((gains.i_clamp_min / gains.i, gains.i_clamp_max / gains.i))
            total = min(max(total, bounds[0]), bounds[1])
        self._sum = total
        return gains.p * error + _integral_term(gains, total) + gains.d * error_rate

    def _change_gains(self) -> None:
        """Switches to the new gains and keeps the integral term unchanged."""
        term = _integral_term(self._gains, self._sum)
        self._gains = self.gains
        self._sum = term / self._gains.i if self._gains.i != 0.0 else 0.0


def _integral_term(gains: PidGains, total: float) -> float:
    return min(max(gains.i * total, gains.i_clamp_min), gains.i_clamp_max)


def read_pid(gains_nh: NodeHandle) -> Pid:
    """Reads the gains of one joint.

    `p` is required; defaults are `i` 0, `d` 0, `i_clamp` 0 (or `i_clamp_min`, `i_clamp_max`), `antiwindup` false.
    As in ros_control, an `i_clamp` of 0 disables the integral term.

    Raises:
        ParameterError: `p` is missing, or a value has the wrong type.
    """
    if not gains_nh.has_param("p"):
        raise ParameterError(
            f"parameter {join_names(gains_nh.namespace, 'p')} is not set; a joint that is controlled "
            "by velocity or effort needs gains: p, and optionally i, d, i_clamp, antiwindup"
        )
    p, i, d = (read_number(gains_nh, key, 0.0, None) for key in ("p", "i", "d"))
    clamp = abs(read_number(gains_nh, "i_clamp", 0.0, None))
    i_min = -abs(read_number(gains_nh, "i_clamp_min", -clamp, None))
    i_max = abs(read_number(gains_nh, "i_clamp_max", clamp, None))
    return Pid(PidGains(p, i, d, i_min, i_max, read_bool(gains_nh, "antiwindup", False)))
