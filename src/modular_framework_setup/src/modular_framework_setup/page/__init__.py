# SPDX-License-Identifier: BSD-3-Clause
"""HTML page about a config package."""
