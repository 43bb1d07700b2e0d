# SPDX-License-Identifier: BSD-3-Clause
"""Execute trajectories by the controllers of a robot."""
