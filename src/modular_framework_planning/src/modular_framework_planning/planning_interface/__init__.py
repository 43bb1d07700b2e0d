# SPDX-License-Identifier: BSD-3-Clause
"""Interface between planners and planning pipelines: requests, problems, results and collision checkers."""
