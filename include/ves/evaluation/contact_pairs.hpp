// SPDX-License-Identifier: BSD-3-Clause
//
// The contacts of a run beside those that the robot would have had on its base in free space.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "ves/evaluation/comparison.hpp"

namespace ves {

/// Of the first admittance segment, times from its start. Of contacts that began in the same tick
/// only the last one is known.
std::vector<Contact> contactsOf(const Series& series);

/// One of a run, and the one with the same number in free space.
struct ContactPair {
  std::optional<Contact> emulated, free_space;

  /// [-] of the energy of approach in free space, by which vehicle, robot and what floats have
  /// gained more from before the contact until kAfter later than in free space, or until they touch
  /// again. The work of the robot's joints counts in both. NaN unless both are over.
  double energy_error = NAN;
  static constexpr double kAfter = 0.5;  // [s] in which the machine has answered
};
std::vector<ContactPair> contactPairs(const Series& series, const std::optional<Emulation>& e);

/// Named numbers, units at their ends: of each contact, and of the first and the hardest by
/// themselves.
void addContacts(const Series& series, const std::optional<Emulation>& e,
                 nlohmann::ordered_json& out);

/// The energy account of admittance control (control/energy_account.hpp).
void addEnergy(const Series& series, nlohmann::ordered_json& out);

/// Of a summary with contacts: the first few, each beside the one in free space.
std::string contactTable(const nlohmann::ordered_json& summary);

/// A CSV file, a line a contact.
void writeContacts(const std::vector<ContactPair>& pairs, const std::string& file);

}  // namespace ves
