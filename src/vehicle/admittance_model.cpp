// SPDX-License-Identifier: BSD-3-Clause
#include "ves/vehicle/admittance_model.hpp"

namespace ves {

ModalModel linearised(const VehicleModel& model) {
  if (const auto* modes = std::get_if<ModalModel>(&model)) return *modes;
  return linearised(std::get<FreeBodyModel>(model));
}

AdmittanceModel::AdmittanceModel(const VehicleModel& model, double period)
    : kind_([&] {
        if (const auto* free = std::get_if<FreeBodyModel>(&model))
          return Kinds(std::in_place_type<FreeBody>, *free, period);
        return Kinds(std::in_place_type<ModalVehicle>, std::get<ModalModel>(model), period);
      }()) {}

}  // namespace ves
