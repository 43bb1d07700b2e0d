# SPDX-License-Identifier: BSD-3-Clause
"""The checks of a config package, one subject a module."""
