# SPDX-License-Identifier: BSD-3-Clause
"""The xacro language with packages found the ROS 1 way.

PyPI's xacro looks packages up in the ament index of ROS 2. Here ``$(find pkg)`` goes through rospkg, that is along
``ROS_PACKAGE_PATH``. The library is deliberately not called ``xacro``:
that name belongs to the PyPI module this one drives.
"""

from xacro_rospkg.expansion import PackageNotFoundError, expand, main

__all__ = ["PackageNotFoundError", "expand", "main"]
