# SPDX-License-Identifier: BSD-3-Clause
"""Parts of the control loop that work with other threads: its pace, its clock, goals on their way, mailboxes."""
