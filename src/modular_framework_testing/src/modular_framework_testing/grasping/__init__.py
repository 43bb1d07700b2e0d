# SPDX-License-Identifier: BSD-3-Clause
"""The conformance suite of grasp generators, and the move_group that it fakes."""
