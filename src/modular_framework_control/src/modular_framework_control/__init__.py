# SPDX-License-Identifier: BSD-3-Clause
"""Hardware interfaces, controller manager and controllers in Python, under the names of ros_control."""
