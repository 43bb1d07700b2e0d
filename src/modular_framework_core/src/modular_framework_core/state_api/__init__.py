# SPDX-License-Identifier: BSD-3-Clause
"""What an author of states works with: the base class, and the annotations that declare options."""
