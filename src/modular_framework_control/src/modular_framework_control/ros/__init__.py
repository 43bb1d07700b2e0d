# SPDX-License-Identifier: BSD-3-Clause
"""Topics, services, actions and nodes of the control loop."""
