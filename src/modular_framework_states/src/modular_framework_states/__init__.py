# SPDX-License-Identifier: BSD-3-Clause
"""The states of which tasks consist."""
