# SPDX-License-Identifier: BSD-3-Clause
"""Planning pipelines: a planner, its request adapters and the final validation of every motion."""
