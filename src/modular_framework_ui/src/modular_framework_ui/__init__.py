# SPDX-License-Identifier: BSD-3-Clause
"""The page in the browser that shows a running task."""
