# Some ROS wheels on PyPI export the include folder of the machine that built them
# (/opt/python/cp311-.../include). CMake refuses an imported target whose include folder is not
# there, so take those plain paths out. On an ordinary ROS installation every path exists and
# nothing changes.
#
# Include this after the find_package calls of an interface package.

foreach(_package
    service_msgs action_msgs builtin_interfaces rcl_interfaces
    type_description_interfaces unique_identifier_msgs std_msgs)
  find_package(${_package} QUIET)
endforeach()

get_property(_targets DIRECTORY PROPERTY IMPORTED_TARGETS)
foreach(_target IN LISTS _targets)
  get_target_property(_folders ${_target} INTERFACE_INCLUDE_DIRECTORIES)
  if(NOT _folders)
    continue()
  endif()
  set(_kept "")
  foreach(_folder IN LISTS _folders)
    # Generator expressions cannot be looked up now, and are never the wheel's mistake.
    if(_folder MATCHES "\\$<" OR EXISTS "${_folder}")
      list(APPEND _kept "${_folder}")
    endif()
  endforeach()
  set_target_properties(${_target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${_kept}")
endforeach()
