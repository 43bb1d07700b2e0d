# SPDX-License-Identifier: BSD-3-Clause
"""Shows results: a page, figures, tables."""
