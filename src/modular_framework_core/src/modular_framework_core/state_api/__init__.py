# SPDX-License-Identifier: BSD-3-Clause
"""The interface for authors of states: the base class, and the annotations that declare options."""
