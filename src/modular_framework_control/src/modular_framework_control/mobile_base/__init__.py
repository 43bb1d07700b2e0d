# SPDX-License-Identifier: BSD-3-Clause
"""Controllers of mobile bases."""
