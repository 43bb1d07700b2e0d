# SPDX-License-Identifier: BSD-3-Clause
"""Path shortening and time parameterization."""
