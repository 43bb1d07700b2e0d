# SPDX-License-Identifier: BSD-3-Clause
"""Methods and tests that `create_method` copies."""
