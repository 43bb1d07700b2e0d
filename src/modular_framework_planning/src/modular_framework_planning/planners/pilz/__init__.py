# SPDX-License-Identifier: BSD-3-Clause
"""Industrial motions that run exactly as asked: point to point, straight lines, arcs, and sequences of them."""
