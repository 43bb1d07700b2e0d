# SPDX-License-Identifier: BSD-3-Clause
"""Universal Robots arms over RTDE."""
