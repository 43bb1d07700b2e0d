# SPDX-License-Identifier: BSD-3-Clause
"""Publisher of joint states, with an optional window that has a slider per independent joint."""
