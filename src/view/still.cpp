// SPDX-License-Identifier: BSD-3-Clause
#include "ves/view/still.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace ves {
namespace {

using Json = nlohmann::ordered_json;

double number(const Json& x) { return x.get<double>(); }
Vec3 point(const Json& p) { return Vec3(number(p[0]), number(p[1]), number(p[2])); }

/// Bodies as strokes and polygons, those behind first.
class Drawing {
 public:
  void stroke(const Vec3& a, const Vec3& b, double width, const char* colour, bool round) {
    include(a, width);
    include(b, width);
    const Vec3 p = seen(a), q = seen(b);
    things_.push_back(
        {0.5 * (p.z() + q.z()),
         fmt::format("<line x1=\"{:.4f}\" y1=\"{:.4f}\" x2=\"{:.4f}\" y2=\"{:.4f}\" stroke=\"{}\" "
                     "stroke-width=\"{:.4f}\" stroke-linecap=\"{}\"/>\n",
                     p.x(), p.y(), q.x(), q.y(), colour, width, round ? "round" : "butt")});
  }
  void polygon(const std::vector<Vec3>& corners, const char* colour) {
    std::string points;
    double depth = 0.0;
    for (const Vec3& corner : corners) {
      include(corner, 0.0);
      const Vec3 p = seen(corner);
      points += fmt::format("{:.4f},{:.4f} ", p.x(), p.y());
      depth += p.z() / static_cast<double>(corners.size());
    }
    things_.push_back(
        {depth, fmt::format("<polygon points=\"{}\" fill=\"{}\"/>\n", points, colour)});
  }
  std::string svg() {
    std::stable_sort(things_.begin(), things_.end(),
                     [](const Thing& a, const Thing& b) { return a.depth < b.depth; });
    const double margin = 0.03 * (high_ - low_).norm();
    std::string out = fmt::format(
        "<svg viewBox=\"{:.4f} {:.4f} {:.4f} {:.4f}\" xmlns=\"http://www.w3.org/2000/svg\">\n",
        low_.x() - margin, low_.y() - margin, high_.x() - low_.x() + 2.0 * margin,
        high_.y() - low_.y() + 2.0 * margin);
    for (const Thing& thing : things_) out += thing.text;
    return out + "</svg>\n";
  }

 private:
  struct Thing {
    double depth;  // [m] towards the eye
    std::string text;
  };
  /// To the right, down, towards the eye.
  static Vec3 seen(const Vec3& p) {
    const Vec3 eye = Vec3(0.62, -0.95, 0.5).normalized();
    const Vec3 right = Vec3::UnitZ().cross(eye).normalized(), up = eye.cross(right);
    return {right.dot(p), -up.dot(p), eye.dot(p)};
  }
  void include(const Vec3& p, double width) {
    const Eigen::Vector2d at = seen(p).head<2>(), room = Eigen::Vector2d::Constant(0.5 * width);
    low_ = low_.cwiseMin(at - room);
    high_ = high_.cwiseMax(at + room);
  }

  std::vector<Thing> things_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Constant(HUGE_VAL);
  Eigen::Vector2d high_ = Eigen::Vector2d::Constant(-HUGE_VAL);
};

constexpr const char* kMetal = "#8d99a6";
constexpr const char* kPlate = "#6b7885";
constexpr const char* kRobot = "#e0903a";
constexpr const char* kArm = "#b9a878";

}  // namespace

std::string still(const Scene& scene, const std::vector<float>& picture, StillView view) {
  const Json& d = scene.description();
  std::map<std::string, Transform> frames = {{"", Transform()}};
  std::size_t at = 0;
  for (const Json& frame : d["frames"]) {
    const float* p = picture.data() + at;
    const Transform X{Eigen::Quaterniond(p[6], p[3], p[4], p[5]).toRotationMatrix(),
                      Vec3(p[0], p[1], p[2])};
    frames[frame["name"].get<std::string>()] = frames[frame["parent"].get<std::string>()] * X;
    at += 7;
  }
  Drawing drawing;
  for (const Json& shape : d["shapes"]) {
    const Transform& X = frames[shape["frame"].get<std::string>()];
    const auto kind = shape["kind"].get<std::string>();
    if (kind == "plate") {
      std::vector<Vec3> corners;
      for (const Json& c : shape["corners"])
        corners.push_back(X * Vec3(number(c[0]), number(c[1]), number(shape["top"])));
      drawing.polygon(corners, kPlate);
    } else if (kind == "cylinder") {
      const Vec3 from = shape.contains("from") ? point(shape["from"]) : Vec3(Vec3::Zero());
      drawing.stroke(X * from, X * Vec3(from + Vec3(0.0, 0.0, number(shape["length"]))),
                     2.0 * number(shape["radius"]), kMetal, false);
    } else if (kind == "rod" || kind == "sphere" || kind == "box") {  // meshes are too fine
      const Json& q = shape["quaternion"];
      const Transform here =
          X * Transform{Eigen::Quaterniond(number(q[3]), number(q[0]), number(q[1]), number(q[2]))
                            .toRotationMatrix(),
                        point(shape["position"])};
      Vec3 half(0.0, 0.0, 0.0);
      double width = 0.0;
      if (kind == "box") {
        const Vec3 size = point(shape["size"]);
        Eigen::Index longest = 0;
        size.maxCoeff(&longest);
        half(longest) = 0.5 * size(longest);
        width = std::sqrt(size.prod() / size(longest));
      } else {
        if (kind == "rod") half.z() = 0.5 * number(shape["length"]);
        width = 2.0 * number(shape["radius"]);
      }
      drawing.stroke(here * Vec3(-half), here * half, width, kRobot, kind == "sphere");
    } else if (kind == "capsule") {
      drawing.stroke(X * point(shape["from"]), X * point(shape["to"]),
                     2.0 * number(shape["radius"]), kRobot, true);
    }
  }
  if (view == StillView::kArm)
    for (std::size_t i = 1; i < d["arm"].size(); ++i)
      drawing.stroke(point(d["arm"][i - 1]), point(d["arm"][i]), 2.0 * number(d["arm_radius"]),
                     kArm, true);
  return drawing.svg();
}

std::string stillAtStart(const Experiment& experiment, StillView view) {
  Row row;
  Vec6::Map(row.state.x_measured).setZero();
  JointVector::Map(row.sample.q) = experiment.plant.initial_joints;
  row.has_sample = true;
  const Scene scene(experiment);
  return still(scene, scene.picture(row, {}), view);
}

}  // namespace ves
