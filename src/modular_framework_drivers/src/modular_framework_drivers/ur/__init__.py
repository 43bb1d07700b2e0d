# SPDX-License-Identifier: BSD-3-Clause
"""Driver of Universal Robots arms over RTDE."""
