# SPDX-License-Identifier: BSD-3-Clause
"""Hardware of one's own, to begin with."""
