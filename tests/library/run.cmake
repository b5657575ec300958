# Installs BUILD into a folder of its own, builds apps/examples/library against that with find_package
# alone, and runs every program there.
function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE result OUTPUT_VARIABLE out ERROR_VARIABLE out)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "${ARGV}: ${result}\n${out}")
  endif()
  message("${out}")
endfunction()

file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)
run(${CMAKE_COMMAND} -S ${SOURCE}/apps/examples/library -B ${WORK}/build -G Ninja
  -DCMAKE_PREFIX_PATH=${WORK}/prefix -DCMAKE_CXX_FLAGS=-Wall\ -Wextra\ -Werror)
run(${CMAKE_COMMAND} --build ${WORK}/build)
set(config ${WORK}/prefix/share/ves/config)
run(${WORK}/build/hexapod)
run(${WORK}/build/admittance)
run(${WORK}/build/newton_euler ${config}/robots/puma560.urdf)
run(${WORK}/build/controller ${config}/scenarios/puma_on_table_4_1.yaml)

# Other flags give the same numbers, or do not compile.
set(FLAGS -std=c++23 "-O3 -msse4.2" -O0 -mavx -mavx2 -D_GLIBCXX_DEBUG -DEIGEN_MAX_ALIGN_BYTES=32
    -DEIGEN_DONT_VECTORIZE)
file(WRITE ${WORK}/flags/flags.cmake "set(FLAGS \"${FLAGS}\")\n")
file(WRITE ${WORK}/flags/CMakeLists.txt [[
cmake_minimum_required(VERSION 3.25)
project(flags LANGUAGES CXX)
find_package(ves 0.1 REQUIRED COMPONENTS control)
include(flags.cmake)
foreach(flags IN LISTS FLAGS)
  string(MAKE_C_IDENTIFIER "push${flags}" name)
  add_executable(${name} EXCLUDE_FROM_ALL push.cpp)
  target_link_libraries(${name} PRIVATE ves::control)
  separate_arguments(options UNIX_COMMAND "${flags}")
  target_compile_options(${name} PRIVATE ${options})
  if(flags MATCHES "-std=c\\+\\+(..)")  # which CMake's own would follow
    set_target_properties(${name} PROPERTIES CXX_STANDARD ${CMAKE_MATCH_1} CXX_EXTENSIONS OFF)
  endif()
endforeach()
]])
file(WRITE ${WORK}/flags/push.cpp [[
// 10 kg on 1000 N/m without damping, 1 N for 1 s: x = F/k (1 - cos(sqrt(k/m) t)).
#include <cmath>
#include <ves/vehicle/admittance_model.hpp>
int main() {
  ves::ModalModel m;
  m.Phi = ves::Vec6::Unit(0) / std::sqrt(10.0);
  m.stiffness = Eigen::VectorXd::Constant(1, 100.0);
  m.damping = Eigen::MatrixXd::Zero(1, 1);
  ves::AdmittanceModel model(m, 0.01);
  model.reset(ves::Vec6::Zero());
  for (int i = 0; i < 100; ++i) model.step({{1.0, 0.0, 0.0}, ves::Vec3::Zero()});
  return std::abs(model.motion().x(0) - 1e-3 * (1.0 - std::cos(10.0))) < 1e-9 ? 0 : 1;
}
]])
run(${CMAKE_COMMAND} -S ${WORK}/flags -B ${WORK}/flags/build -G Ninja
  -DCMAKE_PREFIX_PATH=${WORK}/prefix)
foreach(flags IN LISTS FLAGS)
  string(MAKE_C_IDENTIFIER "push${flags}" name)
  execute_process(COMMAND ${CMAKE_COMMAND} --build ${WORK}/flags/build --target ${name}
    RESULT_VARIABLE failed OUTPUT_VARIABLE out ERROR_VARIABLE out)
  if(NOT failed)
    run(${WORK}/flags/build/${name})
  elseif(NOT out MATCHES "error:.*ves: ")
    message(FATAL_ERROR "${flags}: another error than that of ves/math/layout.hpp\n${out}")
  endif()
  list(APPEND built_${failed} ${flags})
endforeach()
if(NOT "${built_0}" STREQUAL "-std=c++23;-O3 -msse4.2;-O0")
  message(FATAL_ERROR "these flags compile: ${built_0}")
endif()

# A driver of legs needs the bus, and with it nothing of files, plants or robots' descriptions.
run(${CMAKE_COMMAND} -S ${SOURCE}/apps/examples/driver -B ${WORK}/driver -G Ninja
  -DCMAKE_PREFIX_PATH=${WORK}/prefix -DCMAKE_CXX_FLAGS=-Wall\ -Wextra\ -Werror)
run(${CMAKE_COMMAND} --build ${WORK}/driver)
execute_process(COMMAND ninja -C ${WORK}/driver -t commands legs_driver OUTPUT_VARIABLE commands)
execute_process(COMMAND ldd ${WORK}/driver/legs_driver OUTPUT_VARIABLE libraries)
message("${libraries}")
if(NOT libraries MATCHES "liblcm")
  message(FATAL_ERROR "the driver links no LCM:\n${libraries}")
endif()
foreach(other yaml gsl kdl expat)
  if("${commands}${libraries}" MATCHES "${other}")
    message(FATAL_ERROR "the driver brings ${other}:\n${commands}\n${libraries}")
  endif()
endforeach()

# What is not there is said, and the control path asks for Eigen alone.
file(WRITE ${WORK}/none/CMakeLists.txt "cmake_minimum_required(VERSION 3.25)\nproject(none CXX)\n"
  "find_package(ves 0.1 REQUIRED COMPONENTS warp)\n")
execute_process(COMMAND ${CMAKE_COMMAND} -S ${WORK}/none -B ${WORK}/none/build
  -DCMAKE_PREFIX_PATH=${WORK}/prefix RESULT_VARIABLE result OUTPUT_QUIET ERROR_VARIABLE out)
if(result EQUAL 0 OR NOT out MATCHES "warp")
  message(FATAL_ERROR "a component that does not exist: ${result}\n${out}")
endif()
file(WRITE ${WORK}/alone/CMakeLists.txt "cmake_minimum_required(VERSION 3.25)\nproject(alone CXX)\n"
  "find_package(ves 0.1 REQUIRED COMPONENTS contract control)\n"
  "foreach(other fmt::fmt yaml-cpp lcm::lcm ves::plant)\n"
  "  if(TARGET \${other})\n    message(FATAL_ERROR \"brings \${other}\")\n  endif()\nendforeach()\n")
run(${CMAKE_COMMAND} -S ${WORK}/alone -B ${WORK}/alone/build -DCMAKE_PREFIX_PATH=${WORK}/prefix)
# No public header shows a library that its component does not link.
file(GLOB_RECURSE headers ${WORK}/prefix/include/ves/*/*.hpp)
foreach(header ${headers})
  file(STRINGS ${header} leaks REGEX "#include <(lcm|gsl|nlohmann|yaml-cpp|fmt|kdl|urdf)")
  if(leaks)
    message(FATAL_ERROR "${header}: ${leaks}")
  endif()
endforeach()
