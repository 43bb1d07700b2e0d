# SPDX-License-Identifier: BSD-3-Clause
"""What a robot offers to controllers: handles, interfaces, limits, transmissions, and the hardware itself."""
