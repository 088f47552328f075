# Some ROS wheels on PyPI export an include folder of the machine that built them
# (/opt/python/cp311-.../include). CMake rejects an imported target whose include folder does not
# exist, so these paths are removed. In a ROS installation all paths exist, and nothing changes.
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
    # Generator expressions cannot be evaluated here. They are never wrong in the wheels.
    if(_folder MATCHES "\\$<" OR EXISTS "${_folder}")
      list(APPEND _kept "${_folder}")
    endif()
  endforeach()
  set_target_properties(${_target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${_kept}")
endforeach()
