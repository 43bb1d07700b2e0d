# SPDX-License-Identifier: BSD-3-Clause
"""Python interface of the controller manager under its public name."""
