# SPDX-License-Identifier: BSD-3-Clause
"""Keep the planning scene up to date with what topics, tf and sensors say."""
