# Writes OUT with the revision of the source in ROOT; leaves it alone when nothing has changed.
execute_process(COMMAND git -C ${ROOT} describe --always --dirty=+changes --exclude=*
  OUTPUT_VARIABLE revision OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
if(failed)
  set(revision "unknown")
endif()
file(CONFIGURE OUTPUT ${OUT} CONTENT "#pragma once
#include <string_view>
namespace ves {
inline constexpr std::string_view kRevision = \"${revision}\";
}
")
