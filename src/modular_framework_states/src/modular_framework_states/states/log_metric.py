# SPDX-License-Identifier: BSD-3-Clause
"""A state that publishes a figure of the task."""

from __future__ import annotations

import json
import math
from typing import Annotated, Any, Unpack

import rospy
from std_msgs.msg import String

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Finite
from modular_framework_core.state_api.option_uses import Key

TOPIC = "task_metrics"


class LogMetric(FrameworkState):
    """Publishes a figure on ``task_metrics`` (std_msgs/String, JSON: name, value, unit, time) and logs it.

    Args:
        name_of_metric: Name of the figure.
        value: Value of the figure; without it, the value of the userdata key ``from_key``.
        from_key: Input key with the value.
        unit: Unit of the value.
        **keys: Outcomes and userdata keys of any state.
    """

    def __init__(
        self,
        name_of_metric: str,
        value: Finite | None = None,
        from_key: Annotated[str, Key("input")] = "",
        unit: str = "",
        **keys: Unpack[StateKeys],
    ) -> None:
        super().__init__(**keys)
        if (value is None) == (not from_key):
            raise ValueError("LogMetric: give either value or from_key")
        if from_key and from_key not in self.get_registered_input_keys():
            raise ValueError(
                f"LogMetric: from_key is '{from_key}', which is none of the input keys "
                f"{sorted(self.get_registered_input_keys())}; add it to input_keys"
            )
        self._metric, self._value, self._key, self._unit = str(name_of_metric), value, from_key, unit
        self._publisher = rospy.Publisher(TOPIC, String, queue_size=100, latch=True)

    def execute(self, userdata: Any) -> str:
        """Publishes the figure."""
        value = userdata[self._key] if self._key else self._value
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            return self.fail(f"metric '{self._metric}' is {value!r}; a finite number is needed")
        self._publisher.publish(
            String(json.dumps({"name": self._metric, "value": value, "unit": self._unit, "time": rospy.get_time()}))
        )
        rospy.loginfo("metric %s = %s %s", self._metric, value, self._unit)
        return self.succeed()
