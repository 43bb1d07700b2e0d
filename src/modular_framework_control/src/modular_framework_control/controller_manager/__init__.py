# SPDX-License-Identifier: BSD-3-Clause
"""The controller manager."""
