# SPDX-License-Identifier: BSD-3-Clause
"""Says how sure a difference between methods is: intervals, tests, corrections, sequential stopping, sentences."""
