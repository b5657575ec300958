// SPDX-License-Identifier: BSD-3-Clause
#include "ves/page/still.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace ves {
namespace {

using Json = nlohmann::ordered_json;

double number(const Json& x) { return x.get<double>(); }
Vec3 point(const Json& p) { return Vec3(number(p[0]), number(p[1]), number(p[2])); }

/// Bodies as strokes and polygons, seen from above and aside.
class Drawing {
 public:
  /// A line of two ends, or a polygon.
  struct Thing {
    double depth = 0.0;               // [m] towards the eye
    std::vector<Eigen::Vector2d> at;  // [m] to the right, down
    bool closed = false;
    std::string look;  // its other attributes

    std::string points() const {
      std::string out;
      for (const Eigen::Vector2d& p : at)
        out += fmt::format("{}{:.4f},{:.4f}", out.empty() ? "" : " ", p.x(), p.y());
      return out;
    }
  };

  void stroke(const Vec3& a, const Vec3& b, double width, std::string_view colour, bool round) {
    add({a, b}, width, false,
        fmt::format("stroke=\"{}\" stroke-width=\"{:.4f}\" stroke-linecap=\"{}\"", colour, width,
                    round ? "round" : "butt"));
  }
  void polygon(const std::vector<Vec3>& corners, const char* colour) {
    add(corners, 0.0, true, fmt::format("fill=\"{}\"", colour));
  }

  /// What is there, told beside the drawing.
  void caption(const Vec3& p, const char* text) { captions_.push_back({seen(p), text}); }

  struct Caption {
    Eigen::Vector2d at;
    const char* text;
  };
  const std::vector<Caption>& captions() const { return captions_; }
  const std::vector<Thing>& things() const { return things_; }
  const Eigen::AlignedBox2d& box() const { return box_; }

 private:
  static Vec3 eye() { return Vec3(0.62, -0.95, 0.5).normalized(); }
  static Eigen::Vector2d seen(const Vec3& p) {
    const Vec3 right = Vec3::UnitZ().cross(eye()).normalized(), up = eye().cross(right);
    return {right.dot(p), -up.dot(p)};
  }
  void add(const std::vector<Vec3>& points, double width, bool closed, std::string look) {
    Thing thing;
    thing.closed = closed;
    thing.look = std::move(look);
    for (const Vec3& p : points) {
      thing.depth += eye().dot(p) / static_cast<double>(points.size());
      thing.at.push_back(seen(p));
      const Eigen::Vector2d room = Eigen::Vector2d::Constant(0.5 * width);
      box_.extend(thing.at.back() - room).extend(thing.at.back() + room);
    }
    things_.push_back(std::move(thing));
  }

  std::vector<Thing> things_;
  std::vector<Caption> captions_;
  Eigen::AlignedBox2d box_;
};

/// To the right of it, those above first, each with a line to its place.
std::string captions(std::vector<Drawing::Caption> all, const Eigen::AlignedBox2d& box) {
  std::sort(all.begin(), all.end(),
            [](const auto& a, const auto& b) { return a.at.y() < b.at.y(); });
  const double size = 0.032 * box.sizes().y(), x = box.max().x() + size;
  double lowest = box.min().y();
  std::string out;
  for (const Drawing::Caption& c : all) {
    const double y = lowest = std::max(c.at.y(), lowest + 1.6 * size);
    out += fmt::format(
        "<polyline points=\"{:.3f},{:.3f} {:.3f},{:.3f}\" fill=\"none\" stroke=\"#888888\" "
        "stroke-width=\"{:.4f}\"/>\n<text x=\"{:.3f}\" y=\"{:.3f}\" font-size=\"{:.3f}\" "
        "font-family=\"sans-serif\" fill=\"#767676\">{}</text>\n",
        c.at.x(), c.at.y(), x - 0.3 * size, y, 0.06 * size, x, y + 0.35 * size, size, c.text);
  }
  return out;
}

/// One drawing, or several of the same things as they move, the last one `seconds` after the first;
/// those behind first.
std::string svg(const std::vector<Drawing>& drawings, double seconds) {
  constexpr double kTold = 0.75;  // [-] of the height, for captions
  Eigen::AlignedBox2d box;
  for (const Drawing& d : drawings) box.extend(d.box());
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(0.03 * box.diagonal().norm());
  const std::vector<Drawing::Caption>& told = drawings.front().captions();
  Eigen::AlignedBox2d room = box;
  if (!told.empty())  // for letters about half as wide as high
    room.extend(Eigen::Vector2d(box.max() + Eigen::Vector2d(kTold * box.sizes().y(), 0.0)));
  const Eigen::Vector2d low = room.min() - margin, size = room.sizes() + 2.0 * margin;
  std::string out = fmt::format(
      "<svg viewBox=\"{:.4f} {:.4f} {:.4f} {:.4f}\" xmlns=\"http://www.w3.org/2000/svg\">\n",
      low.x(), low.y(), size.x(), size.y());
  const std::vector<Drawing::Thing>& first = drawings.front().things();
  std::vector<std::size_t> order(first.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return first[a].depth < first[b].depth; });
  for (const std::size_t i : order) {
    const char* const kind = first[i].closed ? "polygon" : "polyline";
    out += fmt::format("<{} points=\"{}\" {}{}", kind, first[i].points(),
                       first[i].closed ? "" : "fill=\"none\" ", first[i].look);
    std::string values;
    bool moves = false;
    for (const Drawing& d : drawings) {
      const std::string points = d.things()[i].points();
      moves = moves || points != first[i].points();
      values += (values.empty() ? "" : ";") + points;
    }
    out += moves ? fmt::format(
                       "><animate attributeName=\"points\" dur=\"{:g}s\" "
                       "repeatCount=\"indefinite\" values=\"{}\"/></{}>\n",
                       seconds, values, kind)
                 : "/>\n";
  }
  return out + captions(told, box) + "</svg>\n";
}

constexpr const char* kMetal = "#8d99a6";
constexpr const char* kPlates = "#6b7885";
constexpr const char* kRobot = "#e0903a";
constexpr const char* kArm = "#b9a878";

/// One instant of a scene, by its numbers (Scene::picture).
Drawing drawn(const Scene& scene, const std::vector<float>& picture, StillView view) {
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
  for (std::size_t i = 0; i < d["legs"].size(); ++i) {
    const Vec3 from = point(d["legs"][i][0]), to = frames["platform"] * point(d["legs"][i][1]);
    // How they are turned about the leg does not matter.
    const Vec3 z = (to - from).normalized(), x = z.unitOrthogonal();
    const Mat3 R = (Mat3() << x, z.cross(x), z).finished();
    frames[fmt::format("leg{}", i + 1)] = {R, from};
    frames[fmt::format("rod{}", i + 1)] = {R, to};
  }
  Drawing drawing;
  for (const Json& shape : d["shapes"]) {
    const Transform& X = frames[shape["frame"].get<std::string>()];
    const auto kind = shape["kind"].get<std::string>();
    const std::string colour =
        shape.contains("colour") ? fmt::format("#{:06x}", shape["colour"].get<int>()) : kRobot;
    if (kind == "plate") {
      std::vector<Vec3> corners;
      for (const Json& c : shape["corners"])
        corners.push_back(X * Vec3(number(c[0]), number(c[1]), number(shape["top"])));
      drawing.polygon(corners, kPlates);
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
      drawing.stroke(here * Vec3(-half), here * half, width, colour, kind == "sphere");
    } else if (kind == "capsule") {
      drawing.stroke(X * point(shape["from"]), X * point(shape["to"]),
                     2.0 * number(shape["radius"]), colour, true);
    }
  }
  if (view == StillView::kArm)
    for (std::size_t i = 1; i < d["arm"].size(); ++i)
      drawing.stroke(point(d["arm"][i - 1]), point(d["arm"][i]), 2.0 * number(d["arm_radius"]),
                     kArm, true);
  return drawing;
}

}  // namespace

std::string stillAtStart(const Experiment& experiment, StillView view) {
  Row row;
  Vec6::Map(row.state.x_measured).setZero();
  JointVector::Map(row.sample.q) = experiment.plant.task.initial_joints;
  row.has_sample = true;
  const Scene scene(experiment);
  return svg({drawn(scene, scene.picture(row, {}), view)}, 0.0);
}

std::string moving(const Series& series, const MovingOptions& options) {
  const Scene scene(series.experiment);
  std::vector<Drawing> drawings;
  for (const Row& row : series.rows) {
    const double next = options.from + static_cast<double>(drawings.size()) / options.rate;
    if (row.t < next - 0.5e-9 || row.t > options.to) continue;
    drawings.push_back(drawn(scene, scene.picture(row, {}), StillView::kPlatform));
    if (drawings.size() > 1) continue;
    const Experiment& e = series.experiment;
    const Transform X_IP = e.plant.geometry.fromHome(Pose::from(Vec6::Map(row.truth.x)));
    const LinkPoses links = linkPoses(e.plant.payload.robot, JointVector::Map(row.truth.q));
    Drawing& first = drawings.back();
    if (const NamedFrame* tool = e.robot.tool())
      first.caption(X_IP * (e.plant.payload.X_PL0() * tool->pose(links).p), "a robot moves");
    first.caption(X_IP * e.plant.payload.X_PS.p, "a sensor under it feels its forces");
    const std::size_t corner = 0;
    first.caption(X_IP * e.plant.geometry.p_PPi_P[corner],
                  "the platform goes where a vehicle would");
    first.caption(
        0.5 * (X_IP * e.plant.geometry.p_PPi_P[corner] + e.plant.geometry.p_IBi_I[corner]),
        "on six hydraulic legs");
  }
  if (drawings.empty())
    throw InputError(fmt::format("nothing between {} and {} s: the log has 0 to {:.2f} s",
                                 options.from, options.to,
                                 series.rows.empty() ? 0.0 : series.rows.back().t));
  return svg(drawings, static_cast<double>(drawings.size() - 1) / options.rate);
}

}  // namespace ves
