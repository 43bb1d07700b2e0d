# SPDX-License-Identifier: BSD-3-Clause
"""The control loop beside other threads: its pace and clock, the mailboxes and goal handles it shares with them."""
