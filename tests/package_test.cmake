# Run by ctest: cmake -DBUILD=... -DLOBE=... -P package_test.cmake
# Builds the two libraries for any x86-64 machine and without the renderer, installs them into a new prefix, and builds and
# runs the example against that prefix alone. Without much optimisation, because most of the time is that of the compiler.
set(work ${BUILD}/package-test)
file(REMOVE_RECURSE ${work})
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()
run(${CMAKE_COMMAND} -S ${LOBE} -B ${work}/lobe -G Ninja -DCMAKE_BUILD_TYPE=Release -DLOBE_NATIVE=OFF -DLOBE_BUILD_RENDERER=OFF
    -DLOBE_BUILD_TESTS=OFF "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG")
run(${CMAKE_COMMAND} --build ${work}/lobe)
run(${CMAKE_COMMAND} --install ${work}/lobe --prefix ${work}/prefix)
run(${CMAKE_COMMAND} -S ${LOBE}/examples/minimal_path_tracer -B ${work}/example -DCMAKE_BUILD_TYPE=Release
    -DCMAKE_PREFIX_PATH=${work}/prefix)
run(${CMAKE_COMMAND} --build ${work}/example)
run(${work}/example/minimal_path_tracer)
file(REMOVE_RECURSE ${work})
