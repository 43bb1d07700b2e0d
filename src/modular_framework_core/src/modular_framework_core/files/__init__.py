# SPDX-License-Identifier: BSD-3-Clause
"""Files that people write: read with the line of every value, and written atomically."""
