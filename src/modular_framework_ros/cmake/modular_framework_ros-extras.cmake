# SPDX-License-Identifier: BSD-3-Clause

# Registers the rostest suites of the package that calls it: all launch files test/*.test.
function(add_rostest_suites)
  if(CATKIN_ENABLE_TESTING)
    find_package(rostest REQUIRED)
    file(GLOB suites RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} test/*.test)
    foreach(suite ${suites})
      add_rostest(${suite})
    endforeach()
  endif()
endfunction()
