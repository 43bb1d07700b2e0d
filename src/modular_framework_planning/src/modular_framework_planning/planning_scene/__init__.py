# SPDX-License-Identifier: BSD-3-Clause
"""The world around the robot: objects, what it holds, and which bodies may touch."""
