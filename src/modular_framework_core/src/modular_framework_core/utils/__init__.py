# SPDX-License-Identifier: BSD-3-Clause
"""Names of the original framework's helper modules."""
