# SPDX-License-Identifier: BSD-3-Clause
"""The Grasp action and the messages of a grasp."""
