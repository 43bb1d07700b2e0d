# SPDX-License-Identifier: BSD-3-Clause
"""Arm commander under the name that state machines of the original framework import."""
