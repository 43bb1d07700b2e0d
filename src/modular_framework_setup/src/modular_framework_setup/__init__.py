# SPDX-License-Identifier: BSD-3-Clause
"""Makes, checks and shows the planning configuration of a robot."""
