# SPDX-License-Identifier: BSD-3-Clause
"""The xacro language, with package look-up as in ROS 1.

PyPI's xacro looks packages up in the ament index of ROS 2. This library resolves ``$(find pkg)`` with rospkg, along
``ROS_PACKAGE_PATH``. The library is not called ``xacro``, because that is the name of the PyPI module behind this
library.
"""

from xacro_rospkg.expansion import PackageNotFoundError, expand, main

__all__ = ["PackageNotFoundError", "expand", "main"]
