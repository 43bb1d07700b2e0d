# SPDX-License-Identifier: BSD-3-Clause
"""Bodies and experiments with known laws of physics."""
