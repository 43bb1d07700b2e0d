# SPDX-License-Identifier: BSD-3-Clause
"""Creates, checks and shows the planning configuration of a robot."""
