# SPDX-License-Identifier: BSD-3-Clause
"""The framework's states under the package name used by state machines of the original framework.

The folder of the states is found by name, so that this package does not import the package of the states.
"""

from modular_framework_core.files.default_folders import states_folder

__path__ = [str(states_folder())]
