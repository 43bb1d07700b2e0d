# SPDX-License-Identifier: BSD-3-Clause
"""Modules under the names of the original framework."""
