# SPDX-License-Identifier: BSD-3-Clause
"""Controllers of arms, grippers and single joints, and controllers that report joint states and sensors."""
