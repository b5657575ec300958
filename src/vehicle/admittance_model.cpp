// SPDX-License-Identifier: BSD-3-Clause
#include "ves/vehicle/admittance_model.hpp"

namespace ves {

ModalModel linearised(const VehicleModel& model) {
  if (const auto* modes = std::get_if<ModalModel>(&model.kind)) return *modes;
  return linearised(std::get<FreeBodyModel>(model.kind));
}

Propulsion propulsionOf(const VehicleModel& model) noexcept {
  const auto* free = std::get_if<FreeBodyModel>(&model.kind);
  return free ? free->propulsion : Propulsion{};
}

AdmittanceModel::AdmittanceModel(const VehicleModel& model, double period)
    : kind_([&] {
        if (const auto* free = std::get_if<FreeBodyModel>(&model.kind))
          return Kinds(std::in_place_type<FreeBody>, *free, period);
        return Kinds(std::in_place_type<ModalVehicle>, std::get<ModalModel>(model.kind), period,
                     model.ground, model.gravity);
      }()) {}

}  // namespace ves
