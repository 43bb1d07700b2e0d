# SPDX-License-Identifier: BSD-3-Clause
"""Independent checks of plans, a robot and a client of move_group without hardware, and load tests."""
