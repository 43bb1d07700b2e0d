# SPDX-License-Identifier: BSD-3-Clause
"""Controller selection for a motion, and collision checks of its remaining path."""
