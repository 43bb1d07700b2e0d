# SPDX-License-Identifier: BSD-3-Clause
"""States of tasks; each file has one class and is named after the class."""
