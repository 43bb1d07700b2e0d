# SPDX-License-Identifier: BSD-3-Clause
"""A grasp generator for methods that run in their own process and Python environment."""
