# SPDX-License-Identifier: BSD-3-Clause
"""PID control of one joint, with the gains users write below `gains/<joint>` or `pid`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names, read_bool, read_number


@dataclass(frozen=True, slots=True)
class PidGains:
    """Gains under the names of control_toolbox.

    Attributes:
        p: command per error.
        i: command per error and second.
        d: command per rate of the error.
        i_clamp_min: smallest command of the integral's part, at most 0.
        i_clamp_max: largest command of the integral's part, at least 0.
        antiwindup: whether the integral itself is bounded, instead of only its part of the command.
    """

    p: float
    i: float = 0.0
    d: float = 0.0
    i_clamp_min: float = 0.0
    i_clamp_max: float = 0.0
    antiwindup: bool = False


class Pid:
    """Proportional, integral and derivative gain, with a bound on the integral's part of the command.

    Args:
        gains: the initial gains.

    Attributes:
        gains: the gains in use; may be replaced at any time, from any thread. The integral's part of the command goes
            on from where it is.
    """

    __slots__ = ("gains", "_gains", "_sum")

    def __init__(self, gains: PidGains) -> None:
        self.gains = self._gains = gains
        self._sum = 0.0

    def reset(self) -> None:
        """Clears the sum."""
        self._sum = 0.0

    def command(self, error: float, error_rate: float, period_s: float) -> float:
        """The command for an error.

        Args:
            error: desired minus measured.
            error_rate: its change [1/s].
            period_s: time since the last call [s].

        Returns:
            p * error + i * (sum of error * period), bounded, + d * error_rate; 0 for an error that is no number.
        """
        if self.gains is not self._gains:
            self._change_gains()
        gains = self._gains
        if not (math.isfinite(error) and math.isfinite(error_rate)):
            return 0.0
        total = self._sum + error * max(0.0, period_s)
        if gains.antiwindup and gains.i != 0.0:
            ends = sorted((gains.i_clamp_min / gains.i, gains.i_clamp_max / gains.i))
            total = min(max(total, ends[0]), ends[1])
        self._sum = total
        return gains.p * error + _integral_part(gains, total) + gains.d * error_rate

    def _change_gains(self) -> None:
        """Takes over the new gains; a sum that the old ones left unused does not become a command."""
        part = _integral_part(self._gains, self._sum)
        self._gains = self.gains
        self._sum = part / self._gains.i if self._gains.i != 0.0 else 0.0


def _integral_part(gains: PidGains, total: float) -> float:
    return min(max(gains.i * total, gains.i_clamp_min), gains.i_clamp_max)


def read_pid(gains_nh: NodeHandle) -> Pid:
    """Gains of one joint.

    `p` must be there; defaults are `i` 0, `d` 0, `i_clamp` 0 (or `i_clamp_min`, `i_clamp_max`), `antiwindup` false.
    An `i_clamp` of 0 switches the integral off, as in ros_control.

    Raises:
        ParameterError: no `p`, or a value of the wrong kind.
    """
    if not gains_nh.has_param("p"):
        raise ParameterError(
            f"parameter {join_names(gains_nh.namespace, 'p')} is not set; a joint that is controlled "
            "by velocity or effort needs its gains: p, and if wanted i, d, i_clamp, antiwindup"
        )
    p, i, d = (read_number(gains_nh, key, 0.0, None) for key in ("p", "i", "d"))
    clamp = abs(read_number(gains_nh, "i_clamp", 0.0, None))
    i_min = -abs(read_number(gains_nh, "i_clamp_min", -clamp, None))
    i_max = abs(read_number(gains_nh, "i_clamp_max", clamp, None))
    return Pid(PidGains(p, i, d, i_min, i_max, read_bool(gains_nh, "antiwindup", False)))
