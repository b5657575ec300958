# Makes the Debian package of BUILD, unpacks it, runs its program where nothing else of this project is,
# and builds two programs on its library. The clean root is clean_root.sh's business.
function(run)
  execute_process(COMMAND ${ARGV} WORKING_DIRECTORY ${WORK} RESULT_VARIABLE result OUTPUT_VARIABLE out
    ERROR_VARIABLE out)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "${ARGV}: ${result}\n${out}")
  endif()
  set(out "${out}" PARENT_SCOPE)
endfunction()
function(require what)
  if(NOT out MATCHES "${what}")
    message(FATAL_ERROR "want '${what}' in\n${out}")
  endif()
endfunction()

file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})
run(${CMAKE_CPACK_COMMAND} --config ${BUILD}/CPackConfig.cmake -B ${WORK}/cpack)
file(GLOB package ${WORK}/cpack/ves_*.deb)
run(dpkg-deb --field ${package} Depends)
require("libgsl.*liblcm1")
run(dpkg-deb --extract ${package} ${WORK}/root)
set(usr ${WORK}/root/usr)

set(alone ${CMAKE_COMMAND} -E env --unset=VES_CONFIG_DIR)
run(${alone} ${usr}/bin/ves demo --lockstep --quiet --out ${WORK}/demo)
file(READ ${WORK}/demo/summary.json out)
require("\"parked\"")
run(gzip -dc ${usr}/share/man/man1/ves.1.gz)
require("\\.TH VES 1")
run(bash -c "source '${usr}/share/bash-completion/completions/ves' && COMP_WORDS=(ves stab) COMP_CWORD=1
  _ves
  echo $COMPREPLY")
require("stability")
file(READ ${usr}/share/doc/ves/copyright out)
require("GNU Scientific Library")
run(gzip -dc ${usr}/share/doc/ves/changelog.gz)
require("^ves \\(${VERSION}\\)")

run(${CMAKE_COMMAND} -S ${SOURCE}/apps/examples/library -B ${WORK}/build -G Ninja -DCMAKE_PREFIX_PATH=${usr})
run(${CMAKE_COMMAND} --build ${WORK}/build --target hexapod --target controller)
run(${WORK}/build/hexapod)
run(${WORK}/build/controller ${usr}/share/ves/config/scenarios/arm_on_desk.yaml)
