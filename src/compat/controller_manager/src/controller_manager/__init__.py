# SPDX-License-Identifier: BSD-3-Clause
"""The Python side of the controller manager under the name that user scripts import."""
