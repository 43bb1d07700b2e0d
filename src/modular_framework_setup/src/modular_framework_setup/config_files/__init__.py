# SPDX-License-Identifier: BSD-3-Clause
"""The files of a config package, read with their lines."""
