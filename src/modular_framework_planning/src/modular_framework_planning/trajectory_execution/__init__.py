# SPDX-License-Identifier: BSD-3-Clause
"""Choice of the controllers that execute a motion, and the check of its remaining path."""
