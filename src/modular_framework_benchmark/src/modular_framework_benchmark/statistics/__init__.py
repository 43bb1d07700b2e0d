# SPDX-License-Identifier: BSD-3-Clause
"""Statistical analysis of experiments: intervals, tests, multiplicity correction, sequential stopping, sentences."""
