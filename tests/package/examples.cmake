# SPDX-License-Identifier: Apache-2.0
# test_examples(NAME FOLDER): runs each of the examples that were built in FOLDER, as NAME/EXAMPLE.

# The hand ends 20 mm behind the wall, the proxy's centre r_c = 5 mm before it.
set(touch_a_plane_says "hand at 1.020 m, proxy at 0.995 m, force 1[0-9]\\.[0-9] N")
# A person with a stiff grip asks for more than the 3.3 N that the safety chain allows, or less.
set(session_says "6000 ticks, [1-5][0-9][0-9][0-9] in contact.* sent [1-3]\\.[0-9] N")
set(my_method_says "method cushion: pressed in by [1-9]\\.[0-9] mm, felt [1-3]\\.[0-9] N")
set(my_camera_says "breathing wall: 180 frames, felt [1-3]\\.[0-9] N, pop-throughs: 0")
# A newton at 600 N/m takes 1.7 mm.
set(my_device_says "probe: felt 1\\.[0-9] N at a height of -1\\.[5-9] mm")

function(test_examples name folder)
  foreach(example touch_a_plane session my_method my_camera my_device)
    add_test(NAME ${name}/${example} COMMAND ${folder}/${example})
    set_tests_properties(${name}/${example} PROPERTIES TIMEOUT 300
                         PASS_REGULAR_EXPRESSION "${${example}_says}" ${ARGN})
  endforeach()
endfunction()
