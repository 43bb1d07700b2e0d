# SPDX-License-Identifier: BSD-3-Clause
"""Launch helpers and emulated devices for tests and benchmarks, of this framework and of users' packages."""
