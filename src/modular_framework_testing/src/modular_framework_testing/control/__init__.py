# SPDX-License-Identifier: BSD-3-Clause
"""A control loop and hardware for tests of controllers, and the conformance suite of controllers."""
