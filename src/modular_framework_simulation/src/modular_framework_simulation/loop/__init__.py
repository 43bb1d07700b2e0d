# SPDX-License-Identifier: BSD-3-Clause
"""Controllers, physics and simulated time advance together; requests from outside wait their turn."""
