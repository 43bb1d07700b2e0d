# SPDX-License-Identifier: BSD-3-Clause
"""The planning scene: objects, attached objects, padding and allowed collisions."""
