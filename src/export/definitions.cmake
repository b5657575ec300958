# Writes OUT with the definitions of the messages in FILES, by type.
foreach(file ${FILES})
  cmake_path(GET file STEM message)
  file(READ ${file} text)
  string(APPEND definitions "    {\"${message}\", R\"VES(${text})VES\"},\n")
endforeach()
file(WRITE ${OUT} "#pragma once
#include <map>
#include <string>
namespace ves {
inline const std::map<std::string, std::string> kLcmDefinitions = {
${definitions}};
}
")
