# SPDX-License-Identifier: BSD-3-Clause
"""Makes ur_arm_on_ros.py known to the tests beside it."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
