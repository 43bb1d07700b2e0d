# SPDX-License-Identifier: BSD-3-Clause
"""A grasp generator for antipodal contact pairs, approached from above, at an incline or from the side."""
