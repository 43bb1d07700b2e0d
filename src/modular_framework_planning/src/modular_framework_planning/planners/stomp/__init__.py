# SPDX-License-Identifier: BSD-3-Clause
"""The planning pipeline `stomp`: stochastic optimisation of whole motions."""
