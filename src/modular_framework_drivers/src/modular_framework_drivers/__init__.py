# SPDX-License-Identifier: BSD-3-Clause
"""Real devices of the framework and emulators of them."""
