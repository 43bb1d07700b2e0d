# SPDX-License-Identifier: BSD-3-Clause
"""Plans that a seed repeats bit for bit."""
