# SPDX-License-Identifier: BSD-3-Clause
"""A PyBullet world behind the names of Gazebo."""
