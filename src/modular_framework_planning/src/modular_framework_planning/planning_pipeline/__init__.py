# SPDX-License-Identifier: BSD-3-Clause
"""A planner with the request adapters around it and the check every motion has to pass."""
