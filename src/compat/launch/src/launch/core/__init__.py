# SPDX-License-Identifier: BSD-3-Clause
"""Elements of launch descriptions, and the context of their visit."""
