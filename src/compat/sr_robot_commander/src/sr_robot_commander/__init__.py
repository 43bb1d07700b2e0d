# SPDX-License-Identifier: BSD-3-Clause
"""The arm commander under the name that state machines of the original framework import."""
