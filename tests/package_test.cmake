# Run by ctest: cmake -DBUILD=... -DLOBE=... -P package_test.cmake
# Builds the two libraries for any x86-64 machine and without the renderer, installs them into a new prefix, and builds and
# runs the example against that prefix alone. Without much optimisation, because most of the time is that of the compiler.
# Then configures a host that adds Lobe as a subdirectory.
set(work ${BUILD}/package-test)
file(REMOVE_RECURSE ${work})
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()
run(${CMAKE_COMMAND} -S ${LOBE} -B ${work}/lobe -G Ninja -DCMAKE_BUILD_TYPE=Release -DLOBE_NATIVE=OFF -DLOBE_BUILD_RENDERER=OFF
    -DLOBE_BUILD_TESTS=OFF "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG")
run(${CMAKE_COMMAND} --build ${work}/lobe)
run(${CMAKE_COMMAND} --install ${work}/lobe --prefix ${work}/prefix)
run(${CMAKE_COMMAND} -S ${LOBE}/examples/minimal_path_tracer -B ${work}/example -G Ninja -DCMAKE_BUILD_TYPE=Release
    -DCMAKE_PREFIX_PATH=${work}/prefix)
run(${CMAKE_COMMAND} --build ${work}/example)
run(${work}/example/minimal_path_tracer)

# A host with fast mathematics that adds Lobe as a subdirectory. It is only configured, because building it would compile the libraries
# once more.
file(WRITE ${work}/host/CMakeLists.txt "
cmake_minimum_required(VERSION 3.25)
project(host LANGUAGES CXX)
add_compile_options(-ffast-math)
add_subdirectory(${LOBE} lobe)
add_executable(host ${LOBE}/examples/minimal_path_tracer/main.cpp)
target_link_libraries(host PRIVATE lobe::guiding lobe::fitting)
")
run(${CMAKE_COMMAND} -S ${work}/host -B ${work}/host/build -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_EXPORT_COMPILE_COMMANDS=ON
    -DLOBE_BUILD_FITTER=ON)
file(READ ${work}/host/build/compile_commands.json commands)
string(JSON count LENGTH ${commands})
math(EXPR last "${count} - 1")
foreach(i RANGE ${last})
  string(JSON command GET ${commands} ${i} command)
  if(command MATCHES "minimal_path_tracer")
    continue()
  endif()
  if(NOT command MATCHES " -ffast-math .*-fno-fast-math" OR command MATCHES " -fno-math-errno .*-fno-fast-math")
    message(FATAL_ERROR "The host's options apply to the libraries: ${command}")
  endif()
endforeach()
file(REMOVE_RECURSE ${work})
