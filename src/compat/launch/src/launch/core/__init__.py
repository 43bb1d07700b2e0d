# SPDX-License-Identifier: BSD-3-Clause
"""What launch descriptions are made of, and the context they are visited in."""
