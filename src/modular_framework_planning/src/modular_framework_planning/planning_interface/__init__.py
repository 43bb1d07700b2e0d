# SPDX-License-Identifier: BSD-3-Clause
"""The interface of planners: requests, collision checkers, problems and responses."""
