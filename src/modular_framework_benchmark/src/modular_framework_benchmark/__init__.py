# SPDX-License-Identifier: BSD-3-Clause
"""Compares methods: experiments of repeatable episodes, metrics, statistics and reports."""
