# SPDX-License-Identifier: BSD-3-Clause
"""Whether states and motions collide: compiled bounds and Coal's exact checks."""
