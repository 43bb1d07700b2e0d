# SPDX-License-Identifier: BSD-3-Clause
"""The simulation loop, which advances controllers, physics and time, and serves requests between the steps."""
