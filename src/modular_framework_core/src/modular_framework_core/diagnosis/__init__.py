# SPDX-License-Identifier: BSD-3-Clause
"""Checks of an installation, a configuration and a running system, for the command `doctor`."""
