# SPDX-License-Identifier: BSD-3-Clause
"""Properties are tried on the same examples in every run and without a deadline: a verdict depends on the code alone.

Other examples: `HYPOTHESIS_PROFILE=default tests/run unit -m hypothesis --hypothesis-seed=NUMBER`.
"""

from __future__ import annotations

import os

from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))
