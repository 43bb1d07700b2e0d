# SPDX-License-Identifier: BSD-3-Clause
"""The planners, each in a folder of its own."""
