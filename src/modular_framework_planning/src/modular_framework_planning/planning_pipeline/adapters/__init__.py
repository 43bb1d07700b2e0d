# SPDX-License-Identifier: BSD-3-Clause
"""Request adapters, which modify the problem before planning and the path after planning."""
