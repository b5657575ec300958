// SPDX-License-Identifier: BSD-3-Clause
//
// A run as something to look at: bodies fixed in named frames, and the frames' poses over time. All
// geometry is computed here; whoever draws only places what it is told.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "ves/evaluation/comparison.hpp"

namespace ves {

class Scene {
 public:
  /// Keeps nothing of the experiment but what it draws.
  explicit Scene(const Experiment& experiment);

  /// What stays: "name", "frames" (name and parent of each, in the order of a picture's poses),
  /// "legs" (the joints of each, on the floor in I and below the platform in P [m]; frames leg1
  /// and rod1 begin there, z along the leg), "size" [-] beside the report's platform, "shapes"
  /// (kind, frame, sizes [m]), "arm" (the line of the arm at rest, in I [m]), "arm_radius" [m],
  /// "emulates", "simulated", "target" (whether there is one), "scalars" (names), "phases",
  /// "segments", "checks".
  const nlohmann::ordered_json& description() const { return description_; }
  /// Meshes that are not drawn, and why.
  const std::vector<std::string>& warnings() const { return warnings_; }

  /// One instant, as many numbers as width(): seven a frame {p [m], quaternion x y z w} in its
  /// parent, three [m] for each point of the arm, by which it is bent, then the scalars. NaN where
  /// nobody knows. `base`: the pose of the base in free space, from home.
  std::vector<float> picture(const Row& row, const std::optional<Vec6>& base) const;
  std::size_t width() const {
    return 7 * frames_.size() + 3 * arm_.points.size() + scalars_.size();
  }

 private:
  void addFrame(const std::string& name, const std::string& parent);
  void addRobot(const UrdfRobot& robot);
  std::set<int> addVisuals(const UrdfRobot& robot);
  void addMesh(const std::filesystem::path& file, const Visual& visual,
               nlohmann::ordered_json shape);
  void addArm();
  void addEmulated();
  void addPropulsion(const VehicleModel& vehicle);
  Vec3 compass() const;
  void addWorld(const Environment& environment);
  /// A large platform's robot and sensor are no larger.
  double carriedSize() const { return std::min(size_, 1.0); }

  struct Scalar {
    std::string name;
    std::function<double(const Row&)> value;
  };
  Geometry geometry_;
  double size_;  // [-] of the platform, the report's being 1
  Payload payload_;
  std::optional<NamedFrame> tool_;
  std::optional<Floating> target_;  // as it starts
  ArmShape arm_;                    // without points: none
  Eigen::MatrixXd Phi_;             // 6 x k, of the base's tip
  bool flies_;                      // the laboratory does
  std::vector<std::string> frames_;
  std::vector<Scalar> scalars_;
  nlohmann::ordered_json description_;
  std::vector<std::string> warnings_;
};

/// A recorded run for a page: its scene, and pictures at most `rate` [1/s] times a second. What is
/// not drawn is added to `warnings`.
nlohmann::ordered_json recording(const Series& series, double rate,
                                 std::vector<std::string>& warnings);

}  // namespace ves
