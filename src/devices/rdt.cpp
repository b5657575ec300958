// SPDX-License-Identifier: BSD-3-Clause
#include "ves/devices/rdt.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "ves/config/xml.hpp"
#include "ves/core/big_endian.hpp"
#include "ves/core/errors.hpp"

namespace ves::devices {
namespace {

constexpr std::uint16_t kRequest = 0x1234;

std::uint32_t big32(const std::uint8_t* at) { return static_cast<std::uint32_t>(bigEndian(at, 4)); }

void putBig(std::uint8_t* at, std::uint32_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) at[i] = static_cast<std::uint8_t>(value >> (8 * (bytes - 1 - i)));
}

[[noreturn]] void refuse(const std::string& tag, const std::string& why) {
  throw InputError(fmt::format("netftapi2.xml: {}: {}", tag, why));
}

/// Without the blanks around it; nothing where there is no such element.
const std::string* find(const XmlElement& page, const std::string& tag) {
  for (const XmlElement& one : page.children)
    if (one.name == tag) return &one.text;
  return nullptr;
}

const std::string& textOf(const XmlElement& page, const std::string& tag) {
  const std::string* text = find(page, tag);
  if (!text) refuse(tag, "missing");
  return *text;
}

/// Numbers with semicolons between them.
std::vector<double> numbersOf(const std::string& text, const std::string& tag) {
  std::vector<double> out;
  std::istringstream in(text);
  for (std::string one; std::getline(in, one, ';');) {
    char* end = nullptr;
    out.push_back(std::strtod(one.c_str(), &end));
    if (one.empty() || *end != '\0' || !std::isfinite(out.back()))
      refuse(tag, fmt::format("'{}', want numbers", text.substr(0, 40)));
  }
  return out;
}

double positive(const XmlElement& page, const std::string& tag) {
  const std::vector<double> values = numbersOf(textOf(page, tag), tag);
  if (values.size() != 1 || !(values[0] > 1e-6) || !(values[0] < 1e12))
    refuse(tag, fmt::format("'{}', want a number above 0", textOf(page, tag).substr(0, 40)));
  return values[0];
}

struct Unit {
  const char* name;
  double si;  // [N | N m | m | rad]
};
constexpr double kPound = 4.4482216152605, kFoot = 0.3048, kKilogram = 9.80665;
constexpr Unit kForces[] = {{"N", 1.0},
                            {"kN", 1e3},
                            {"lbf", kPound},
                            {"lb", kPound},
                            {"klbf", 1e3 * kPound},
                            {"kgf", kKilogram},
                            {"kg", kKilogram},
                            {"gf", 1e-3 * kKilogram},
                            {"g", 1e-3 * kKilogram}};
constexpr Unit kTorques[] = {{"Nm", 1.0},
                             {"N-m", 1.0},
                             {"Nmm", 1e-3},
                             {"N-mm", 1e-3},
                             {"kNm", 1e3},
                             {"kN-m", 1e3},
                             {"lbf-in", kPound* kFoot / 12.0},
                             {"lb-in", kPound* kFoot / 12.0},
                             {"lbf-ft", kPound* kFoot},
                             {"lb-ft", kPound* kFoot},
                             {"kgf-cm", 1e-2 * kKilogram},
                             {"kg-cm", 1e-2 * kKilogram}};

constexpr Unit kLengths[] = {
    {"m", 1.0}, {"cm", 1e-2}, {"mm", 1e-3}, {"in", kFoot / 12.0}, {"ft", kFoot}};
constexpr Unit kAngles[] = {{"degrees", kDegree}, {"deg", kDegree}, {"radians", 1.0}, {"rad", 1.0}};

template <std::size_t N>
double unit(const XmlElement& page, const std::string& tag, const Unit (&units)[N]) {
  const std::string& text = textOf(page, tag);
  std::string names;
  for (const Unit& u : units) {
    if (text == u.name) return u.si;
    names += fmt::format("{}{}", names.empty() ? "" : ", ", u.name);
  }
  refuse(tag, fmt::format("'{}', want one of {}", text.substr(0, 40), names));
}

/// The box reports the wrench in a frame of somebody's choice. Angles about more than one axis are
/// refused: in which order they turn is not said.
Transform toolTransform(const XmlElement& page) {
  const std::string* given = find(page, "cfgtfx");
  if (!given) return {};
  const std::vector<double> values = numbersOf(*given, "cfgtfx");
  if (values.size() != 6)
    refuse("cfgtfx", fmt::format("'{}', want six numbers", given->substr(0, 60)));
  Vec6 x = Vec6::Map(values.data());
  if (x.isZero(0.0)) return {};
  x.head<3>() *= unit(page, "scfgtdu", kLengths);
  x.tail<3>() *= unit(page, "scfgtau", kAngles);
  if ((x.tail<3>().array() != 0.0).count() > 1)
    refuse("cfgtfx",
           fmt::format("'{}' turns about more than one axis, want one at most: set it to 0 "
                       "and use sensor.rpy_deg",
                       given->substr(0, 60)));
  return {rotation(x.tail<3>()), x.head<3>()};
}

}  // namespace

std::array<std::uint8_t, kRdtRequestSize> encode(const RdtRequest& request) noexcept {
  std::array<std::uint8_t, kRdtRequestSize> out;
  putBig(out.data(), kRequest, 2);
  putBig(out.data() + 2, static_cast<std::uint32_t>(request.command), 2);
  putBig(out.data() + 4, request.samples, 4);
  return out;
}

std::optional<RdtRequest> rdtRequest(const std::uint8_t* data, std::size_t size) noexcept {
  if (size != kRdtRequestSize || (data[0] << 8 | data[1]) != kRequest) return {};
  return RdtRequest{static_cast<RdtCommand>(data[2] << 8 | data[3]), big32(data + 4)};
}

std::array<std::uint8_t, kRdtRecordSize> encode(const RdtRecord& record) noexcept {
  std::array<std::uint8_t, kRdtRecordSize> out;
  putBig(out.data(), record.sequence, 4);
  putBig(out.data() + 4, record.sensor_sequence, 4);
  putBig(out.data() + 8, record.status, 4);
  for (std::size_t i = 0; i < kWrenchChannels; ++i)
    putBig(out.data() + 12 + 4 * i, static_cast<std::uint32_t>(record.counts[i]), 4);
  return out;
}

std::optional<RdtRecord> rdtRecord(const std::uint8_t* data, std::size_t size) noexcept {
  if (size != kRdtRecordSize) return {};
  RdtRecord r;
  r.sequence = big32(data);
  r.sensor_sequence = big32(data + 4);
  r.status = big32(data + 8);
  for (std::size_t i = 0; i < kWrenchChannels; ++i)
    r.counts[i] = static_cast<std::int32_t>(big32(data + 12 + 4 * i));
  return r;
}

NetFtCalibration netFtCalibration(const std::string& xml) {
  const XmlElement page = parseXml(xml, "netftapi2.xml");
  NetFtCalibration out;
  out.counts_per_newton = positive(page, "cfgcpf") / unit(page, "scfgfu", kForces);
  out.counts_per_newton_metre = positive(page, "cfgcpt") / unit(page, "scfgtu", kTorques);
  out.serial = textOf(page, "cfgcalsn");
  out.X_ST = toolTransform(page);
  if (const std::string* filter = find(page, "setuserfilter"); filter && *filter != "0")
    refuse("setuserfilter", fmt::format("'{}': the box filters, and its wrench is late; want 0",
                                        filter->substr(0, 40)));
  return out;
}

std::string netFtXml(const NetFtCalibration& calibration, int records_per_second) {
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\n<netft>\n<runstat>0x00000000</runstat>\n"
      "<cfgcalsel>0</cfgcalsel>\n<cfgnam>VES</cfgnam>\n<cfgcalsn>{}</cfgcalsn>\n"
      "<cfgfu>2</cfgfu>\n<scfgfu>N</scfgfu>\n<cfgtu>3</cfgtu>\n<scfgtu>Nm</scfgtu>\n"
      "<cfgcpf>{:.17g}</cfgcpf>\n<cfgcpt>{:.17g}</cfgcpt>\n<comrdte>Enabled</comrdte>\n"
      "<comrdtrate>{}</comrdtrate>\n</netft>\n",
      calibration.serial, calibration.counts_per_newton, calibration.counts_per_newton_metre,
      records_per_second);
}

static Mat6 countsPerCount(const NetFtCalibration& c, const Mat6& S_proc) {
  Vec6 per_count;
  per_count << Vec3::Constant(1.0 / c.counts_per_newton),
      Vec3::Constant(1.0 / c.counts_per_newton_metre);
  Mat6 to_S;  // of a wrench about To in {T}
  for (int i = 0; i < 6; ++i)
    to_S.col(i) = transfer(c.X_ST, Wrench::from(Vec6(Vec6::Unit(i)))).stacked();
  return S_proc * to_S * per_count.asDiagonal();
}

RdtStream::RdtStream(const NetFtCalibration& c, const Mat6& S_proc, std::int64_t window)
    : window_(countsPerCount(c, S_proc), window) {}

void RdtStream::take(const std::uint8_t* data, std::size_t size, std::int64_t time) noexcept {
  constexpr std::uint32_t kSummary = 0x80000000, kThreshold = 0x00010000;  // a latch, no error
  const auto record = rdtRecord(data, size);
  if (!record) {
    ++counters_.malformed;
    return;
  }
  if (known_) {
    const auto ahead = static_cast<std::int32_t>(record->sequence - sequence_);
    if (ahead <= 0) {
      ++(ahead == 0 ? counters_.repeated : counters_.late);
      return;
    }
    counters_.lost += ahead - 1;
  }
  known_ = true;
  sequence_ = record->sequence;
  ++counters_.records;
  const bool fault = record->status != 0 && record->status != kThreshold &&
                     record->status != (kSummary | kThreshold);
  Vec6 counts;
  for (int i = 0; i < kWrenchChannels; ++i) counts(i) = record->counts[static_cast<std::size_t>(i)];
  window_.take(counts, fault, time);
}

}  // namespace ves::devices
