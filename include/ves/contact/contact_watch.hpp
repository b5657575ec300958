// SPDX-License-Identifier: BSD-3-Clause
//
// Contacts as events: when each began, how hard it was, and what came out of it.
#pragma once

#include <array>

#include "ves/contact/environment.hpp"

namespace ves {

/// From the first touch to the last; several points that touch at once are one contact.
struct Contact {
  double began = 0.0;           // [s]
  double duration = 0.0;        // [s] so far, while it lasts
  double peak = 0.0;            // [N] largest force
  Vec3 impulse = Vec3::Zero();  // [N s] on the tool, in I
  // [m/s] at which the gap closed as it began, and opened as it ended.
  double approach = 0.0, separation = 0.0;  // separation is 0 until it is known

  bool over() const { return separation != 0.0; }
  /// Newton's coefficient.
  double restitution() const { return separation / approach; }
};

/// [m/s] at which a gap opens, or has closed, where it is zero: by a parabola through what it is
/// near and far [s] from there.
inline double endSpeed(double near, double near_gap, double far, double far_gap) noexcept {
  return (near_gap * far * far - far_gap * near * near) / (near * far * (far - near));
}

/// Looks at what touches, in the order of time.
class ContactWatch {
 public:
  /// A platform's speed swings within a controller period of 10 ms, as its command is held: at a
  /// contact's ends it is that of a parabola through gaps so far apart, or, between contacts that
  /// follow sooner, their mean over the time there is.
  static constexpr double kApart = 0.01;  // [s]

  /// At t [s]. A change between two looks is placed where a line through the gaps is zero.
  void see(double t, const Touch& touch) noexcept;

  int count() const noexcept { return count_; }  // [-] contacts begun so far
  bool touching() const noexcept { return touching_; }
  const Contact& last() const noexcept { return contact_; }

 private:
  struct Place {
    double t, gap;  // [s], [m]
  };
  double gapAt(double t) const noexcept;     // [m] NaN before it is known
  double closedAt(double t) const noexcept;  // [m/s]

  int count_ = 0;
  bool touching_ = false;
  Contact contact_;
  double t_ = 0.0;             // [s] of the last look,
  double gap_ = HUGE_VAL;      // [m] and what it saw
  Vec3 force_ = Vec3::Zero();  // [N]
  double parted_ = -1.0;       // [s] where the speed that follows is not known yet,
  double opened_ = 0.0;        // [m] and the gap kApart after it
  // The newest gaps while nothing touches, kStep [s] and more apart.
  static constexpr double kStep = 0.1 * kApart;
  std::array<Place, 24> before_{};
  std::size_t places_ = 0;  // [-] seen since the last contact
};

}  // namespace ves
