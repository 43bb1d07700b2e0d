# SPDX-License-Identifier: BSD-3-Clause
"""Maps of occupied and free voxels, as OctoMap keeps them."""
