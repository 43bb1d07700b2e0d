# SPDX-License-Identifier: BSD-3-Clause
"""Interface for authors of states: the base class and the annotations of options."""
