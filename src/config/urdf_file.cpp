// SPDX-License-Identifier: BSD-3-Clause
#include "urdf_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "ves/core/spelling.hpp"
#include "ves/config/xml.hpp"
#include "ves/math/dense.hpp"

namespace ves {
namespace {

constexpr double kMaxLength = 1e3;                   // [m]
constexpr double kMaxMass = 1e6;                     // [kg]
constexpr double kMaxInertia = 1e9;                  // [kg m^2]
constexpr double kNoInertia = 1e-6;                  // [kg m^2] whose sign does not matter
constexpr double kMaxRatio = 1e3;                    // [-] of a joint that follows
constexpr double kOddLength = 100.0;                 // [m] more is likely in mm
constexpr double kOddMass = 1e4;                     // [kg] more is likely in g
constexpr double kTurn = 2.0 * M_PI * (1.0 + 1e-3);  // [rad] more is likely in degrees
// [rad] wrists of industrial robots turn by 400 and 450 degrees either way, but not by more.
constexpr double kManyTurns = 2.0 * kTurn;
// Limits that stand for none are larger than any that somebody would have given in degrees.
constexpr double kNoLimit = 1e3;  // [rad]

// A body against its link's size.
constexpr double kSmallest = 0.05;         // [m] a link counts as so large at least
constexpr double kUnknown = 1.0;           // [m] the same, of one whose shape is not known
constexpr double kFelt = 0.01;             // [kg m^2] less makes no difference
constexpr double kTimesTooLarge = 5.0;     // [-]
constexpr double kTimesTooSmall = 1000.0;  // [-]

/// What is no part of masses, motion or picture here, wherever it stands: controllers, contact,
/// sensors, other programs' settings. Nothing below it is looked at.
const std::set<std::string_view> kHarmlessElements = {"gazebo",
                                                      "transmission",
                                                      "ros2_control",
                                                      "sensor",
                                                      "frame",
                                                      "collision_filter_group",
                                                      "dynamics",
                                                      "calibration",
                                                      "safety_controller",
                                                      "hardwareInterface",
                                                      "controller_gains",
                                                      "joint_properties",
                                                      "traits",
                                                      "contact",
                                                      "contact_coefficients",
                                                      "collision_checking",
                                                      "self_collision_checking",
                                                      "self_filter",
                                                      "surface",
                                                      "verbose",
                                                      "texture"};
const std::set<std::string_view> kHarmlessAttributes = {
    "version", "dont_collapse",  "group",   "acceleration",  "deceleration", "jerk",  "iyx", "izx",
    "izy",     "command_effort", "current", "gear_velocity", "k_velocity",   "convex"};

/// What others call it.
const std::pair<std::string_view, std::string_view> kOtherWords[] = {
    {"rotation", "rpy"},     {"rot", "rpy"},          {"orientation", "rpy"},
    {"euler", "rpy"},        {"translation", "xyz"},  {"position", "xyz"},
    {"pos", "xyz"},          {"min", "lower"},        {"max", "upper"},
    {"minimum", "lower"},    {"maximum", "upper"},    {"parent_link", "parent"},
    {"child_link", "child"}, {"scale", "size"},       {"dim", "size"},
    {"file", "filename"},    {"ratio", "multiplier"}, {"speed", "velocity"},
    {"force", "effort"},     {"weight", "mass"}};

/// Warnings; those of one kind are one, with whom else it is about.
class Warnings {
 public:
  explicit Warnings(const std::string& file) : file_(file) {}
  void add(int line, const std::string& of, const std::string& kind, const std::string& more = "") {
    const auto known = std::find_if(kinds_.begin(), kinds_.end(),
                                    [&](const Kind& one) { return one.kind == kind; });
    if (known != kinds_.end()) {
      ++known->more;
      if (known->of.insert(of).second && known->of.size() <= kNamed)
        known->also += fmt::format("{}{}", known->also.empty() ? "" : ", ", of);
    } else if (kinds_.size() < kMost) {
      kinds_.push_back(
          {kind, {of}, fmt::format("{}:{}: {}: {}{}", file_, line, of, kind, more), "", 0});
    } else {
      ++left_out_;
    }
  }
  std::vector<std::string> texts() const {
    std::vector<std::string> out;
    for (const Kind& one : kinds_) {
      out.push_back(one.text);
      if (one.more > 0)
        out.back() += fmt::format("; and {} more{}{}", one.more, one.also.empty() ? "" : ": ",
                                  one.also + (one.of.size() > kNamed ? ", ..." : ""));
    }
    if (left_out_ > 0) out.push_back(fmt::format("{}: {} more warnings", file_, left_out_));
    return out;
  }
  const std::string& file() const { return file_; }

 private:
  static constexpr std::size_t kMost = 50;  // [-] kinds
  static constexpr std::size_t kNamed = 4;  // [-] whom one is about
  struct Kind {
    std::string kind;
    std::set<std::string> of;
    std::string text, also;
    int more;
  };
  std::string file_;
  std::vector<Kind> kinds_;
  int left_out_ = 0;
};

/// An element that cannot be used, without its place.
struct Unusable {
  int line;
  std::string of, what;
};

/// Asks an element for what it may have. What nobody asked for is reported at the end.
class Element {
 public:
  /// `of`: "joint 'a'", whose part it is.
  Element(const XmlElement& xml, Warnings& warnings, std::string of)
      : xml_(&xml), warnings_(&warnings), of_(std::move(of)) {}

  int line() const { return xml_->line; }
  const std::string& name() const { return xml_->name; }
  /// The same, as part of something else.
  Element of(std::string owner) const {
    Element out = *this;
    out.of_ = std::move(owner);
    return out;
  }

  const std::string* attribute(std::string_view key) {
    asked_.insert(key);
    return xml_->attribute(key);
  }
  bool given(std::string_view key) const { return xml_->attribute(key); }
  const std::string& required(std::string_view key) {
    const std::string* value = attribute(key);
    if (!value) {
      for (const auto& [given, text] : xml_->attributes)
        if (meant(given, {key}) == key)
          refuse(fmt::format("unknown attribute '{}', did you mean '{}'?", given, key));
      refuse(fmt::format("attribute '{}' is missing", key));
    }
    return *value;
  }

  /// So many numbers with blanks between them.
  template <int N>
  Eigen::Matrix<double, N, 1> numbers(std::string_view key) {
    const std::string& text = required(key);
    Eigen::Matrix<double, N, 1> out;
    const char *at = text.data(), *end = at + text.size();
    const auto blanks = [&] {
      while (at != end && std::isspace(static_cast<unsigned char>(*at))) ++at;
    };
    bool good = true;
    blanks();
    for (int i = 0; i < N && good; ++i) {
      if (at != end && *at == '+') ++at;
      const auto [next, error] = std::from_chars(at, end, out(i));
      good =
          error == std::errc() && (next == end || std::isspace(static_cast<unsigned char>(*next)));
      at = next;
      blanks();
    }
    if (!good || at != end)
      refuse(fmt::format("{} \"{}\", want {}", key, text,
                         N == 1 ? std::string("a number, as in 0.5, without a unit")
                                : fmt::format("{} numbers with blanks between, as in 0.5", N)));
    return out;
  }
  double number(std::string_view key) { return numbers<1>(key)(0); }
  double numberOr(std::string_view key, double fallback) {
    return attribute(key) ? number(key) : fallback;
  }
  /// Finite, within +- most.
  double within(std::string_view key, double most) {
    const double x = number(key);
    if (!(std::abs(x) <= most)) refuse(fmt::format("{} {}, want a number within {}", key, x, most));
    return x;
  }

  /// The only one of its kind; of more the first.
  std::optional<Element> child(std::string_view name) {
    const std::vector<Element> all = children(name);
    if (all.size() > 1) warn(all[1].line(), fmt::format("a second element '{}' is not used", name));
    if (all.empty()) return {};
    return all.front();
  }
  Element requiredChild(std::string_view name) {
    if (auto one = child(name)) return *one;
    refuse(fmt::format("element '{}' is missing", name));
  }
  std::vector<Element> children(std::string_view name) {
    asked_below_.insert(name);
    std::vector<Element> out;
    for (const XmlElement& one : xml_->children)
      if (one.name == name) out.emplace_back(one, *warnings_, of_);
    return out;
  }

  /// Reports what was not asked for and is not known to be harmless.
  void finish() const {
    for (const auto& [key, value] : xml_->attributes) {
      if (asked_.count(key) || kHarmlessAttributes.count(key) || key.rfind("xmlns", 0) == 0 ||
          key.find(':') != std::string::npos)
        continue;
      warn(line(), fmt::format("unknown attribute '{}' of {}{}", key, name(),
                               didYouMean(meant(key, asked_))));
    }
    for (const XmlElement& one : xml_->children) {
      if (asked_below_.count(one.name) || kHarmlessElements.count(one.name) ||
          one.name.rfind("drake:", 0) == 0)
        continue;
      if (one.name.rfind("xacro:", 0) == 0)
        throw Unusable{one.line, of_,
                       fmt::format("'<{}>' is left of xacro: expand the file first, as 'xacro IN > "
                                   "OUT.urdf' does",
                                   one.name)};
      warn(one.line, fmt::format("unknown element '{}' of {}{}", one.name, name(),
                                 didYouMean(meant(one.name, asked_below_))));
    }
    if (!xml_->text.empty())
      warn(line(), fmt::format("text \"{}\" in {} is not used", xml_->text.substr(0, 40), name()));
  }

  void warn(int at, const std::string& kind) const { warn(at, kind, ""); }
  /// `kind` is told with whose it is, and `more` of it.
  void warn(int at, const std::string& kind, const std::string& more) const {
    warnings_->add(at, of_, kind, more);
  }
  [[noreturn]] void refuse(const std::string& what) const {
    const bool whole = of_.rfind(name() + " ", 0) == 0 || of_ == name();
    throw Unusable{line(), of_, whole ? what : fmt::format("{}: {}", name(), what)};
  }

 private:
  using Keys = std::set<std::string_view>;

  /// The known word that an unknown one stands for; empty when none is near.
  static std::string_view meant(const std::string& given, const Keys& known) {
    for (const auto& [other, word] : kOtherWords)
      if (given == other && known.count(word)) return word;
    const std::string near = nearest(given, known);
    const auto at = known.find(near);
    return at == known.end() ? std::string_view() : *at;
  }
  static std::string didYouMean(std::string_view word) {
    return word.empty() ? "" : fmt::format(", did you mean '{}'?", word);
  }

  const XmlElement* xml_;
  Warnings* warnings_;
  std::string of_;
  Keys asked_, asked_below_;
};

/// Fixed-axis angles as the quaternion of their halves, normalised.
Mat3 rotationOfRpy(const Vec3& rpy) {
  const Vec3 half = rpy / 2.0;
  const double sr = std::sin(half(0)), cr = std::cos(half(0)), sp = std::sin(half(1)),
               cp = std::cos(half(1)), sy = std::sin(half(2)), cy = std::cos(half(2));
  double x = sr * cp * cy - cr * sp * sy, y = cr * sp * cy + sr * cp * sy,
         z = cr * cp * sy - sr * sp * cy, w = cr * cp * cy + sr * sp * sy;
  const double s = std::sqrt(x * x + y * y + z * z + w * w);
  return Eigen::Quaterniond(w / s, x / s, y / s, z / s).normalized().toRotationMatrix();
}

class Reader {
 public:
  Reader(const std::string& text, const std::string& file)
      : document_(parseXml(text, file)), warnings_(file) {}

  UrdfFile read() {
    Element root(document_, warnings_, "robot");
    if (root.name() != "robot") root.refuse("is no URDF, want <robot> around it");
    root.attribute("name");
    for (Element& material : root.children("material")) picture([&] { readMaterial(material); });
    UrdfFile out;
    for (Element& link : root.children("link")) out.links.push_back(readLink(link));
    for (Element& joint : root.children("joint")) out.joints.push_back(readJoint(joint));
    root.finish();
    for (const UrdfLink& link : out.links) judgeBody(link, out.joints);
    out.warnings = warnings_.texts();
    return out;
  }

 private:
  /// What of a picture cannot be read is left out of it, with a warning.
  template <typename F>
  void picture(F f) {
    try {
      f();
    } catch (const Unusable& fault) {
      warnings_.add(fault.line, fault.of, fault.what, "; not drawn");
    }
  }

  UrdfLink readLink(Element link) {
    UrdfLink out;
    out.name = link.required("name");
    out.line = link.line();
    link = link.of(fmt::format("link '{}'", out.name));
    link.attribute("type");
    if (auto inertial = link.child("inertial")) out.body = readInertial(*inertial);
    for (Element& one : link.children("visual"))
      picture([&] { out.visuals.push_back(readShape(one)); });
    for (Element& one : link.children("collision"))
      picture([&] { out.collisions.push_back(readShape(one)); });
    link.finish();
    return out;
  }

  static Transform readOrigin(Element& parent) {
    auto origin = parent.child("origin");
    if (!origin) return {};
    Transform out;
    if (origin->attribute("xyz")) out.p = origin->numbers<3>("xyz");
    const bool quaternion = origin->attribute("quat_xyzw");
    if (origin->attribute("rpy")) {
      const Vec3 rpy = origin->numbers<3>("rpy");
      if (quaternion) origin->refuse("has rpy and quat_xyzw, want one of them");
      if (rpy.cwiseAbs().maxCoeff() > kTurn)
        origin->warn(origin->line(), "rpy is more than a turn: degrees?",
                     fmt::format(" ({:g} {:g} {:g}, read as rad)", rpy(0), rpy(1), rpy(2)));
      out.R = rotationOfRpy(rpy);
    } else if (quaternion) {
      const Eigen::Vector4d q = origin->numbers<4>("quat_xyzw");
      if (!(q.norm() > 1e-6)) origin->refuse("quat_xyzw has no direction");
      out.R = Eigen::Quaterniond(q(3), q(0), q(1), q(2)).normalized().toRotationMatrix();
    }
    if (!out.R.allFinite() || !(out.p.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= kMaxLength))
      origin->refuse(fmt::format("want finite numbers, lengths within {} m", kMaxLength));
    if (out.p.cwiseAbs().maxCoeff() > kOddLength)
      origin->warn(origin->line(), fmt::format("is {} m and more away: mm?", kOddLength),
                   fmt::format(" ({:g} {:g} {:g})", out.p(0), out.p(1), out.p(2)));
    origin->finish();
    return out;
  }

  static RigidBody readInertial(Element& inertial) {
    const Transform X_link_com = readOrigin(inertial);
    Element mass = inertial.requiredChild("mass"), inertia = inertial.requiredChild("inertia");
    RigidBody body;
    body.mass = mass.number("value");
    if (!(body.mass >= 0.0 && body.mass <= kMaxMass))
      mass.refuse(fmt::format("{}, want a number in [0, {}]", body.mass, kMaxMass));
    if (body.mass > kOddMass)
      mass.warn(mass.line(), fmt::format("mass of {} kg and more: g?", kOddMass),
                fmt::format(" ({:g})", body.mass));
    body.p_BoBcm_B = X_link_com.p;
    Vec6 moments;  // an Eigen initializer must not be left by an exception
    int next = 0;
    for (const char* key : {"ixx", "iyy", "izz", "ixy", "ixz", "iyz"})
      moments(next++) = inertia.within(key, kMaxInertia);
    const Mat3 about = inertiaOf(moments);
    body.I_Bcm_B = X_link_com.R * about * X_link_com.R.transpose();
    judgeInertia(inertia, body.mass, symmetricEigenvalues(about));
    mass.finish();
    inertia.finish();
    inertial.finish();
    return body;
  }

  /// `principal` [kg m^2], the smallest first.
  static void judgeInertia(const Element& inertia, double mass, const Vec3& principal) {
    if (principal(0) < -std::max(kNoInertia, 1e-12 * principal(2)))
      inertia.refuse(fmt::format("principal moment of inertia {}, want at least 0", principal(0)));
    if (principal(2) > (principal(0) + principal(1)) * (1.0 + 1e-9))
      inertia.warn(inertia.line(),
                   "no rigid body has a principal moment larger than the sum of the others",
                   fmt::format(": {:.4g}, {:.4g}, {:.4g} kg m^2, used as given", principal(0),
                               principal(1), principal(2)));
    if (mass == 0.0 && principal(2) > 0.0)
      inertia.warn(inertia.line(), "an inertia without a mass", ", counted");
  }

  /// Whether a body is of the size of its link: shapes, and joints that it carries. A mesh is not
  /// opened.
  void judgeBody(const UrdfLink& link, const std::vector<UrdfJoint>& joints) {
    if (!link.body || !(link.body->mass > 0.0)) return;
    double size = 0.0;  // [m] farthest from the link's origin
    bool known = false;
    for (const auto* shapes : {&link.visuals, &link.collisions})
      for (const Visual& shape : *shapes) {
        if (shape.kind == Visual::Kind::kMesh) continue;
        known = true;
        size = std::max(size, shape.X_frame.p.norm() + shape.size.norm());
      }
    for (const UrdfJoint& joint : joints)
      if (joint.parent == link.name) size = std::max(size, joint.X_parent.p.norm());
    const double centre = link.body->p_BoBcm_B.norm();
    const double inertia = symmetricEigenvalues(link.body->I_Bcm_B)(2), mass = link.body->mass,
                 gyration = std::sqrt(inertia / mass);
    const std::string of = fmt::format("link '{}'", link.name);
    const double most = std::max({size, centre, known ? kSmallest : kUnknown});
    if (gyration > kTimesTooLarge * most && inertia > kFelt)
      warnings_.add(
          link.line, of, "its inertia is that of a far larger body: mm, or g?",
          fmt::format(" (radius of gyration {:.3g} m, its link {:.3g} m)", gyration, most));
    else if (known && gyration < most / kTimesTooSmall && mass * most * most > kFelt)
      warnings_.add(
          link.line, of, "its inertia is that of a point",
          fmt::format(" (radius of gyration {:.3g} m, its link {:.3g} m)", gyration, most));
    if (known && centre > kTimesTooLarge * std::max(size, kSmallest))
      warnings_.add(link.line, of, "its centre of mass is far outside of it",
                    fmt::format(" ({:.3g} m away, its link {:.3g} m)", centre, size));
  }

  UrdfJoint readJoint(Element joint) {
    UrdfJoint out;
    out.name = joint.required("name");
    out.line = joint.line();
    joint = joint.of(fmt::format("joint '{}'", out.name));
    out.type = typeOf(joint);
    const auto link = [&](const char* which) {
      Element element = joint.requiredChild(which);
      const std::string name = element.required("link");
      element.finish();
      return name;
    };
    out.parent = link("parent");
    out.child = link("child");
    out.X_parent = readOrigin(joint);
    const bool moves = out.type != UrdfJoint::Type::kFixed;
    if (auto axis = joint.child("axis")) {
      if (moves) {
        out.axis = axis->numbers<3>("xyz");
        if (!(out.axis.norm() > 1e-6) || !out.axis.allFinite()) axis->refuse("has no direction");
        out.axis.normalize();
      } else {
        axis->attribute("xyz");
      }
      axis->finish();
    }
    readLimit(joint, out);
    if (auto mimic = joint.child("mimic")) {
      out.mimic = UrdfJoint::Mimic{mimic->required("joint"), 1.0, 0.0};
      if (mimic->attribute("multiplier")) out.mimic->ratio = mimic->within("multiplier", kMaxRatio);
      if (mimic->attribute("offset")) out.mimic->offset = mimic->within("offset", kMaxLength);
      mimic->finish();
    }
    joint.finish();
    return out;
  }

  static UrdfJoint::Type typeOf(Element& joint) {
    using Type = UrdfJoint::Type;
    const std::string& type = joint.required("type");
    for (const auto& [name, meaning] : {std::pair{"fixed", Type::kFixed},
                                        {"revolute", Type::kRevolute},
                                        {"continuous", Type::kContinuous},
                                        {"prismatic", Type::kPrismatic}})
      if (type == name) return meaning;
    joint.refuse(fmt::format(
        "type '{}' is not supported, want revolute, continuous, prismatic or fixed", type));
  }

  static void readLimit(Element& joint, UrdfJoint& out) {
    using Type = UrdfJoint::Type;
    auto limit = joint.child("limit");
    const bool bounded = out.type == Type::kRevolute || out.type == Type::kPrismatic;
    if (!limit) {
      if (bounded) joint.refuse("a joint of this type wants an element 'limit'");
      return;
    }
    // What a fixed joint has of a limit says nothing.
    for (const char* key : {"lower", "upper", "effort", "velocity"}) limit->attribute(key);
    if (out.type != Type::kFixed) {
      limit->number("effort");
      const double lower = limit->numberOr("lower", 0.0), upper = limit->numberOr("upper", 0.0),
                   fastest = limit->number("velocity");
      const int line = limit->line();
      if (bounded) {
        out.lower = lower;
        out.upper = upper;
        if (!(lower <= upper))
          limit->refuse(fmt::format("[{}, {}], want lower <= upper", lower, upper));
        const std::string range = fmt::format(" ([{:g}, {:g}])", lower, upper);
        if (lower == upper && !limit->given("lower") && !limit->given("upper"))
          limit->warn(line, "has neither lower nor upper: the joint cannot move");
        else if (lower == upper)
          limit->warn(line, "lower and upper are the same: the joint cannot move", range);
        const double most = std::max(-lower, upper);
        if (out.type == Type::kRevolute && most > kManyTurns && most < kNoLimit)
          limit->warn(line, "a limit of more than two turns: degrees?", range + ", read as rad");
        if (out.type == Type::kPrismatic && most > kOddLength && most < kMaxLength)
          limit->warn(line, fmt::format("a limit of {} m and more: mm?", kOddLength), range);
      }
      if (fastest > 0.0)
        out.fastest = fastest;
      else
        limit->warn(line, fastest == 0.0 ? "velocity 0" : "velocity is not above 0",
                    ": taken as no limit");
    }
    limit->finish();
  }

  // --- Of the picture alone

  /// A colour of its own, or that of its name.
  std::optional<Vec3> readMaterial(Element& material) {
    const std::string* name = material.attribute("name");
    if (!name) material.warn(material.line(), "a material without a name");
    std::optional<Vec3> out;
    if (auto color = material.child("color")) {
      out = color->numbers<4>("rgba").head<3>().cwiseMax(0.0).cwiseMin(1.0);
      color->finish();
      if (name) colours_[*name] = *out;
    } else if (const auto known = colours_.find(name ? *name : ""); known != colours_.end()) {
      out = known->second;
    }
    material.finish();
    return out;
  }

  Visual readShape(Element& shape) {
    shape.attribute("name");
    Visual out;
    out.X_frame = readOrigin(shape);
    for (Element& material : shape.children("material"))
      picture([&] { out.colour = readMaterial(material); });
    Element geometry = shape.requiredChild("geometry");
    geometry.attribute("name");
    using Kind = Visual::Kind;
    int found = 0;
    for (const auto& [name, kind] : {std::pair{"box", Kind::kBox},
                                     {"cylinder", Kind::kCylinder},
                                     {"sphere", Kind::kSphere},
                                     {"capsule", Kind::kCapsule},
                                     {"mesh", Kind::kMesh}})
      for (Element& one : geometry.children(name)) {
        out.kind = kind;
        readSize(one, out);
        ++found;
      }
    geometry.finish();
    shape.finish();
    if (found == 0) geometry.refuse("has no shape");
    return out;
  }

  static void readSize(Element& one, Visual& out) {
    switch (out.kind) {
      case Visual::Kind::kBox: out.size = one.numbers<3>("size"); break;
      case Visual::Kind::kCylinder:
      case Visual::Kind::kCapsule:
        out.size = {one.number("radius"), one.number("length"), 0.0};
        break;
      case Visual::Kind::kSphere: out.size = {one.number("radius"), 0.0, 0.0}; break;
      case Visual::Kind::kMesh:
        out.mesh = one.required("filename");
        if (one.attribute("scale")) out.size = one.numbers<3>("scale");
        break;
    }
    one.attribute("name");
    one.finish();
    if (!(out.size.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= kMaxLength) || out.size(0) == 0.0)
      one.refuse("has no size that can be drawn");
  }

  XmlElement document_;
  Warnings warnings_;
  std::map<std::string, Vec3> colours_;  // of materials by name
};

}  // namespace

UrdfFile readUrdf(const std::string& text, const std::string& file) {
  try {
    return Reader(text, file).read();
  } catch (const Unusable& fault) {
    throw InputError(fmt::format("{}:{}: {}: {}", file, fault.line, fault.of, fault.what));
  }
}

}  // namespace ves
