# SPDX-License-Identifier: BSD-3-Clause
"""Messages and services of the controller manager (generated), and `utils`, which finds controllers by them."""
