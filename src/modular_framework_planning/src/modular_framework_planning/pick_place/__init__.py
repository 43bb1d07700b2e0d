# SPDX-License-Identifier: BSD-3-Clause
"""Planning of grasps and releases."""
