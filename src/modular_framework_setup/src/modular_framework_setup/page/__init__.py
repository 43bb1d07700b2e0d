# SPDX-License-Identifier: BSD-3-Clause
"""A page to look at a config package."""
