# SPDX-License-Identifier: BSD-3-Clause
"""Checks the octomap's sensors with the reader used at run time."""

from __future__ import annotations

import re

from modular_framework_core.files.faults import FaultList
from modular_framework_core.files.located_yaml import Mapping, Scalar, Sequence, kind_of
from modular_framework_planning.perception.sensor_settings import read_sensors
from modular_framework_setup.config_files.yaml_files import has_argument, parameters_of

_INDEX_PREFIX = re.compile(r"sensors\[\d+\]: ")


def check_sensors(top: Mapping, faults: FaultList) -> None:
    """Checks sensors_3d.yaml: a list of sensors or, in ROS 2, a list of names of sensors in the same file."""
    top = parameters_of(top)
    sensors = top.entries.get("sensors")
    if not isinstance(sensors, Sequence):
        kind = "nothing" if sensors is None else kind_of(sensors)
        faults.add(sensors.location if sensors else top.location, f"sensors is {kind}; expected a list of sensors")
        return
    for item in sensors.items:
        entry = item
        if isinstance(item, Scalar) and isinstance(item.value, str) and item.value:
            if item.value not in top.entries:
                faults.add_unknown(item.location, "sensors: sensor", item.value, [k for k in top if k != "sensors"])
                continue
            entry = top.entries[item.value]
        if isinstance(entry, Mapping) and any(isinstance(v, str) and has_argument(v) for v in entry.plain().values()):
            continue
        for text in read_sensors([entry.plain()], None)[1]:
            faults.add(entry.location, f"sensor: {_INDEX_PREFIX.sub('', text)}; correct it")
