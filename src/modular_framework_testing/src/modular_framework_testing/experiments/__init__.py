# SPDX-License-Identifier: BSD-3-Clause
"""Experiments with misspelt and impossible names and values."""
