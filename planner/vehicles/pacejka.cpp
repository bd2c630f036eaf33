// SPDX-License-Identifier: Apache-2.0
#include "planner/vehicles/pacejka.h"

#include <cmath>

namespace blindcorner {
namespace {

/// C atan(B x - E (B x - atan(B x))): the argument of the magic formula's sine or cosine.
double magic(double b, double c, double e, double x) {
  const double bx = b * x;
  return c * std::atan(bx - e * (bx - std::atan(bx)));
}

/// cos(atan(x)).
double cosine_of_tangent(double x) { return 1 / std::sqrt(1 + x * x); }

double pure_longitudinal(const PacejkaTyre& t, double slip, double load) {
  const double peak = t.p_dx1 * load;
  const double b = t.p_kx1 * load / (t.p_cx1 * peak);
  // Pacejka adds the vertical shift load p_vx1 to the force; CommonRoad adds it to the sine's
  // argument. Kept: it is 0.05 rad at 5 kN.
  return peak * std::sin(magic(b, t.p_cx1, t.p_ex1, -slip + t.p_hx1) + load * t.p_vx1);
}

double pure_lateral(const PacejkaTyre& t, double slip_angle, double load) {
  const double peak = t.p_dy1 * load;
  const double b = t.p_ky1 * load / (t.p_cy1 * peak);
  return peak * std::sin(magic(b, t.p_cy1, t.p_ey1, slip_angle));
}

/// What is left of the longitudinal force at a slip angle.
double longitudinal_weight(const PacejkaTyre& t, double slip, double slip_angle) {
  const double b = t.r_bx1 * cosine_of_tangent(t.r_bx2 * slip);
  return std::cos(magic(b, t.r_cx1, t.r_ex1, slip_angle + t.r_hx1)) /
         std::cos(magic(b, t.r_cx1, t.r_ex1, t.r_hx1));
}

/// What is left of the lateral force at a longitudinal slip.
double lateral_weight(const PacejkaTyre& t, double slip, double slip_angle) {
  const double b = t.r_by1 * cosine_of_tangent(t.r_by2 * (slip_angle - t.r_by3));
  return std::cos(magic(b, t.r_cy1, t.r_ey1, slip + t.r_hy1)) /
         std::cos(magic(b, t.r_cy1, t.r_ey1, t.r_hy1));
}

/// Lateral force that longitudinal slip causes by itself.
double slip_induced_lateral(const PacejkaTyre& t, double slip, double slip_angle, double load) {
  const double peak = t.p_dy1 * load * t.r_vy1 * cosine_of_tangent(t.r_vy4 * slip_angle);
  return peak * std::sin(t.r_vy5 * std::atan(t.r_vy6 * slip));
}

}  // namespace

Eigen::Vector2d pacejka_force(const PacejkaTyre& tyre, double slip, double slip_angle,
                              double load) {
  return {pure_longitudinal(tyre, slip, load) * longitudinal_weight(tyre, slip, slip_angle),
          pure_lateral(tyre, slip_angle, load) * lateral_weight(tyre, slip, slip_angle) +
              slip_induced_lateral(tyre, slip, slip_angle, load)};
}

}  // namespace blindcorner
