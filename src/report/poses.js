// SPDX-License-Identifier: Apache-2.0
// Poses of hidden objects as a page draws them. `objects` holds the prefix, the known components
// and the outline of each object, `unknowns` the names of a pose's components in order. Lengths are
// metres, angles radians.
function Poses(objects, unknowns) {
  "use strict";
  var CHI2_95 = [0, 3.841, 5.991];  // 95 % quantiles of chi-square, by degrees of freedom

  function finite(value) { return typeof value === "number" && isFinite(value); }
  // Index of an object's component among the unknowns. -1: the component is known.
  function place(name, o) { return unknowns.indexOf(objects[o].prefix + name); }
  // Value of an object's component: from the pose where it is unknown, else from the known
  // placement.
  function component(vector, name, o) {
    var i = place(name, o);
    return i >= 0 && vector && finite(vector[i]) ? vector[i] : objects[o].known[name];
  }
  function point(vector, o) { return [component(vector, "x_m", o), component(vector, "y_m", o)]; }
  function covarianceOf(matrix, a, b, o) {
    var i = place(a, o), j = place(b, o);
    return i >= 0 && j >= 0 && matrix && finite(matrix[i][j]) ? matrix[i][j] : 0;
  }
  function freeInPlane(o) { return (place("x_m", o) >= 0 ? 1 : 0) + (place("y_m", o) >= 0 ? 1 : 0); }
  function eachObject(draw) { objects.forEach(function (unused, o) { draw(o); }); }
  // 95 % ellipse of a mode in the x-y plane: half axes (m) and the long one's angle.
  function ellipse(mode, o) {
    var a = covarianceOf(mode.covariance, "x_m", "x_m", o);
    var b = covarianceOf(mode.covariance, "x_m", "y_m", o);
    var c = covarianceOf(mode.covariance, "y_m", "y_m", o);
    var half = Math.sqrt((a - c) * (a - c) / 4 + b * b);
    var k = CHI2_95[freeInPlane(o)];
    return { long: Math.sqrt(Math.max(0, k * ((a + c) / 2 + half))),
             short: Math.sqrt(Math.max(0, k * ((a + c) / 2 - half))),
             angle: Math.atan2(2 * b, a - c) / 2 };
  }
  function placedObject(vector, o) {
    var at = point(vector, o), yaw = component(vector, "yaw_rad", o), size = component(vector, "size", o);
    var c = Math.cos(yaw) * size, s = Math.sin(yaw) * size;
    return objects[o].outline.map(function (p) {
      return [at[0] + c * p[0] - s * p[1], at[1] + s * p[0] + c * p[1]];
    });
  }
  return { finite: finite, place: place, point: point,
           freeInPlane: freeInPlane, eachObject: eachObject, ellipse: ellipse,
           placedObject: placedObject };
}
