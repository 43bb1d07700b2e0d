# SPDX-License-Identifier: BSD-3-Clause
"""What robot and world descriptions refer to, read in one place."""
