# SPDX-License-Identifier: BSD-3-Clause
"""Which controllers execute a motion, and whether what is left of it is still free."""
