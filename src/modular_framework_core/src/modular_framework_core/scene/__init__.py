# SPDX-License-Identifier: BSD-3-Clause
"""The robot's environment: sensor frames, text scenes and simulated objects."""
