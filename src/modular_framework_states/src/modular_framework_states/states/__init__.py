# SPDX-License-Identifier: BSD-3-Clause
"""The states a task is made of: one class a file, the file named after the class."""
