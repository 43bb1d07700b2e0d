# SPDX-License-Identifier: BSD-3-Clause
"""Shortening and time parameterization of paths."""
