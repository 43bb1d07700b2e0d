# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the base class of substitutions."""

from launch.core.substitution import Substitution as Substitution
