# SPDX-License-Identifier: BSD-3-Clause
"""Reports of results: pages, figures and tables."""
