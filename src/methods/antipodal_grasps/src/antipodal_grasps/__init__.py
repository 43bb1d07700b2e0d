# SPDX-License-Identifier: BSD-3-Clause
"""A method that generates grasps: antipodal pairs of contacts, with the hand from above, inclined or from the side."""
