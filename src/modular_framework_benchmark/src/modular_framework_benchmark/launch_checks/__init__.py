# SPDX-License-Identifier: BSD-3-Clause
"""Checks the launch of an experiment before it starts: names, parameters, controllers, files and the task."""
