# SPDX-License-Identifier: BSD-3-Clause
"""What depth sensors see, without the robot and the objects that are known."""
