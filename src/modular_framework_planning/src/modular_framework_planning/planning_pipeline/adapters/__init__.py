# SPDX-License-Identifier: BSD-3-Clause
"""Request adapters: steps around a planner that correct a request before planning and complete the path after it."""
