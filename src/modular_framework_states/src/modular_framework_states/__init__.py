# SPDX-License-Identifier: BSD-3-Clause
"""The states a task is made of."""
