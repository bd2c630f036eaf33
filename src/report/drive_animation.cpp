// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/scene/footprint.h"
#include "blindcorner/report/drive_report.h"
#include "report/birds_eye.h"
#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;
using Points = std::vector<Vector2d>;

constexpr double kWidth = 640;           ///< px
constexpr double kPause = 1.5;           ///< s, on the last picture before it starts again
constexpr double kChiSquare95 = 5.991;   ///< two degrees of freedom
constexpr std::size_t kPathPoints = 40;  ///< of a plan, at most

/// A part of the world, m.
using Part = Eigen::AlignedBox2d;

Part whole(const GridGeometry& map) {
  return {map.origin, map.origin + Vector2d(map.columns * map.cell_size, map.rows * map.cell_size)};
}

/// Draws a part of the world into a picture of the given width in pixels.
class Canvas {
 public:
  Canvas(const Part& part, double width) : part_(part), scale_(width / part.sizes().x()) {}

  double height() const { return scale_ * part_.sizes().y(); }
  double scale() const { return scale_; }
  Vector2d at(const Vector2d& p) const {
    return {scale_ * (p.x() - part_.min().x()), scale_ * (part_.max().y() - p.y())};
  }
  std::string line(const Points& points, const char* style, bool closed) const {
    std::string text = closed ? "<polygon points=\"" : "<polyline points=\"";
    for (const Vector2d& p : points) text += formatted("%.1f,%.1f ", at(p).x(), at(p).y());
    return text + "\" " + style + "/>";
  }

 private:
  Part part_;
  double scale_;  ///< px per m
};

std::string known_world(const Drive& drive, const Canvas& canvas) {
  std::string roads, buildings;
  for (const Surface& surface : drive.scene.surfaces) {
    const Points outline = footprint(surface.shape, surface.T_world_surface);
    if (std::holds_alternative<BoxShape>(surface.shape)) {
      buildings += canvas.line(outline, "fill=\"#d9d5cd\" stroke=\"#bdb6a8\"", true);
    } else if (outline.size() == 2) {
      buildings += canvas.line(outline, "stroke=\"#8f887b\" stroke-width=\"5\"", false);
    } else {
      roads += canvas.line(outline, "fill=\"#fff\"", true);
    }
  }
  return roads + buildings;
}

/// Colours of the hidden objects in their order: of what is said of them, and of the truth.
constexpr std::array kSaid{"#d55e00", "#7a5ccf", "#8f6b2e", "#3a8fd0"};
constexpr std::array kTrue{"#009e73", "#0072b2", "#e69f00", "#1b1f24"};

/// 95 % ellipse of an object's position in the plane under a mode, and the footprint at its mean.
std::string mode_picture(const Scene& scene, const PoseMode& mode, int object,
                         const Canvas& canvas) {
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  std::array<Eigen::Index, 2> place{-1, -1};
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    const auto axis = static_cast<std::size_t>(scene.unknowns[i].component);
    if (axis < 2 && scene.unknowns[i].object == object) place[axis] = static_cast<Eigen::Index>(i);
  }
  for (Eigen::Index a = 0; a < 2; ++a) {
    for (Eigen::Index b = 0; b < 2; ++b) {
      const auto i = place[static_cast<std::size_t>(a)], j = place[static_cast<std::size_t>(b)];
      if (i >= 0 && j >= 0) covariance(a, b) = mode.covariance(i, j);
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance);
  const Vector2d half = (kChiSquare95 * axes.eigenvalues()).cwiseMax(0).cwiseSqrt();
  const Vector2d along = axes.eigenvectors().col(1);
  const Placement placed = placements_at(scene, mode.pose)[static_cast<std::size_t>(object)];
  const HiddenObject& hidden = hidden_object(scene, object);
  const char* colour = kSaid[static_cast<std::size_t>(object) % kSaid.size()];
  const Vector2d center = canvas.at(placed.position.head<2>());
  return canvas.line(
             footprint(hidden.shape, hidden.anchor, placed),
             formatted("fill=\"%s\" fill-opacity=\".35\" stroke=\"%s\"", colour, colour).c_str(),
             true) +
         formatted(
             "<ellipse rx=\"%.1f\" ry=\"%.1f\" transform=\"translate(%.1f %.1f) "
             "rotate(%.1f)\" fill=\"none\" stroke=\"%s\" stroke-dasharray=\"5 3\"/>",
             canvas.scale() * half[1], canvas.scale() * half[0], center.x(), center.y(),
             -std::atan2(along.y(), along.x()) / kDegree, colour);
}

/// All modes, moved on from the time of the capture to that of the frame.
std::string modes_picture(const Drive& drive, const DriveFrame& frame, const Canvas& canvas) {
  const std::optional<PoseMixture> now = known_later(drive, frame);
  if (!now) return {};
  std::string text;
  for (const PoseMode& mode : now->modes) {
    if (!mode.pose.allFinite()) continue;
    for (int i = 0; i < object_count(drive.scene); ++i) {
      text += mode_picture(drive.scene, mode, i, canvas);
    }
  }
  return text;
}

std::string vehicle_picture(const Drive& drive, const VehicleState& state, const Canvas& canvas) {
  const double l = canvas.scale() * drive.vehicle.length, w = canvas.scale() * drive.vehicle.width;
  const Vector2d at = canvas.at(state.position);
  return formatted("<g transform=\"translate(%.1f %.1f) rotate(%.1f)\">", at.x(), at.y(),
                   -state.yaw / kDegree) +
         formatted(
             "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" rx=\"%.1f\" "
             "fill=\"#3a8fd0\"/>",
             -l / 2, -w / 2, l, w, 0.28 * w) +
         formatted("<path d=\"M%.1f %.1fL%.1f %.1fV%.1fL%.1f %.1fZ\" fill=\"#d2e3fc\"/></g>",
                   0.22 * l, -0.4 * w, 0.06 * l, -0.3 * w, 0.3 * w, 0.22 * l, 0.4 * w);
}

std::string frame_picture(const Drive& drive, const DriveFrame& frame, const Canvas& canvas) {
  const Scene& scene = drive.scene;
  std::string text = canvas.line(
      sensor_outlines(scene, frame.T_world_sensor, {}).field_of_view,
      "fill=\"#f0e442\" fill-opacity=\".25\" stroke=\"#a39200\" stroke-opacity=\".5\"", true);
  Points path;
  const std::size_t step = frame.path.size() / kPathPoints + 1;
  for (std::size_t i = 0; i < frame.path.size(); i += step) path.push_back(frame.path[i]);
  if (!frame.path.empty()) path.push_back(frame.path.back());
  text += canvas.line(path, "fill=\"none\" stroke=\"#0072b2\" stroke-width=\"3.5\"", false);
  text += modes_picture(drive, frame, canvas);
  if (frame.truth) {
    for (int i = 0; i < object_count(scene); ++i) {
      const HiddenObject& object = hidden_object(scene, i);
      const Placement placed = placements_at(scene, *frame.truth)[static_cast<std::size_t>(i)];
      const std::string style = formatted("fill=\"none\" stroke=\"%s\" stroke-width=\"2\"",
                                          kTrue[static_cast<std::size_t>(i) % kTrue.size()]);
      text += canvas.line(footprint(object.shape, object.anchor, placed), style.c_str(), true);
    }
  }
  return text + vehicle_picture(drive, frame.vehicle, canvas);
}

std::string goal_picture(const Drive& drive, const Canvas& canvas) {
  if (drive.finish_line) {
    const Vector2d a = canvas.at(drive.finish_line->front());
    const Vector2d b = canvas.at(drive.finish_line->back());
    return formatted(
        "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"#cc79a7\" "
        "stroke-width=\"3\"/>\n",
        a.x(), a.y(), b.x(), b.y());
  }
  const Vector2d goal = canvas.at(drive.route.back());
  return formatted(
      "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\" fill=\"#cc79a7\" "
      "fill-opacity=\".3\" stroke=\"#cc79a7\"/>\n",
      goal.x(), goal.y(), canvas.scale() * drive.goal_tolerance);
}

/// The frames of one drive. Each is visible until the next one; the last one stays until all drives
/// are over.
std::string frames_picture(const Drive& drive, const DriveResult& result, double total,
                           const Canvas& canvas) {
  std::string text;
  for (std::size_t i = 0; i < result.frames.size(); ++i) {
    const bool last = i + 1 == result.frames.size();
    const double from = result.frames[i].time / total;
    const double to = last ? 1.0 : result.frames[i + 1].time / total;
    text += "<g visibility=\"hidden\">" + frame_picture(drive, result.frames[i], canvas);
    text +=
        "<animate attributeName=\"visibility\" calcMode=\"discrete\" repeatCount=\"indefinite\" ";
    text += formatted("dur=\"%.2fs\" ", total);
    // A value holds from its key time on, and the first key time has to be 0.
    text +=
        i == 0 ? formatted("values=\"visible;hidden\" keyTimes=\"0;%.4f\"/>", to)
        : last ? formatted("values=\"hidden;visible\" keyTimes=\"0;%.4f\"/>", from)
               : formatted("values=\"hidden;visible;hidden\" keyTimes=\"0;%.4f;%.4f\"/>", from, to);
    text += "</g>\n";
  }
  return text;
}

constexpr const char* kGround = "<rect width=\"100%\" height=\"100%\" fill=\"#eef0ee\"/>";

/// The whole picture of one drive.
std::string drive_picture(const Drive& drive, const DriveResult& result, double total,
                          const Canvas& canvas) {
  return kGround + known_world(drive, canvas) + goal_picture(drive, canvas) +
         frames_picture(drive, result, total, canvas);
}

/// The part of the map that vehicle and hidden objects visit in any of the drives, with a margin.
Part part_of(const Drive& drive, const std::vector<AnimatedDrive>& drives) {
  Part part;
  for (const AnimatedDrive& shown : drives) {
    for (const DriveFrame& frame : shown.result->frames) {
      part.extend(frame.vehicle.position);
      if (!frame.truth) continue;
      for (const Placement& placed : placements_at(drive.scene, *frame.truth)) {
        part.extend(Vector2d(placed.position.head<2>()));
      }
    }
  }
  const Vector2d room = Vector2d::Constant(drive.vehicle.length);
  const Part map = whole(drive.map);
  return {(part.min() - room).cwiseMax(map.min()), (part.max() + room).cwiseMin(map.max())};
}

/// The outcome as text, visible from the end of the drive on.
std::string outcome_picture(const DriveResult& result, double total, double right) {
  const bool good = result.outcome == DriveOutcome::reached;
  return formatted(
             "<text x=\"%.0f\" y=\"19\" text-anchor=\"end\" font-weight=\"700\" fill=\"%s\" "
             "visibility=\"hidden\">",
             right, good ? "#188038" : "#c5221f") +
         outcome_word(result.outcome) +
         formatted(
             "<animate attributeName=\"visibility\" calcMode=\"discrete\" "
             "repeatCount=\"indefinite\" dur=\"%.2fs\" values=\"hidden;visible\" "
             "keyTimes=\"0;%.4f\"/></text>\n",
             total, result.time / total);
}

}  // namespace

std::string drive_animation(const Drive& drive, const DriveResult& result) {
  const Canvas canvas(whole(drive.map), kWidth);
  return formatted(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" width=\"%.0f\">",
             kWidth, canvas.height(), kWidth) +
         drive_picture(drive, result, result.time + kPause, canvas) + "</svg>\n";
}

std::string drive_animation(const Drive& drive, const std::vector<AnimatedDrive>& drives) {
  constexpr double kTitle = 28, kGap = 10, kWideFrom = 1.4;
  const Part part = part_of(drive, drives);
  const bool stacked = part.sizes().x() > kWideFrom * part.sizes().y();
  const Canvas canvas(part, stacked ? kWidth : 0.75 * kWidth);
  const double width = stacked ? kWidth : 0.75 * kWidth, height = kTitle + canvas.height();
  double total = 0;
  for (const AnimatedDrive& shown : drives) total = std::max(total, shown.result->time + kPause);
  const auto n = static_cast<double>(drives.size());
  const double all_wide = stacked ? width : n * (width + kGap) - kGap;
  const double all_high = stacked ? n * (height + kGap) - kGap : height;
  std::string text = formatted(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" width=\"%.0f\" "
      "font-family=\"sans-serif\" font-size=\"16\">"
      "<rect width=\"100%%\" height=\"100%%\" fill=\"#fff\"/>\n",
      all_wide, all_high, all_wide);
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const double at = static_cast<double>(i) * ((stacked ? height : width) + kGap);
    text += formatted("<g transform=\"translate(%.1f %.1f)\">", stacked ? 0 : at, stacked ? at : 0);
    text += "<text x=\"6\" y=\"19\" fill=\"#1b1f24\">" + html_safe(drives[i].caption) + "</text>";
    text += outcome_picture(*drives[i].result, total, width - 6);
    text += formatted("<svg y=\"%.0f\" width=\"%.1f\" height=\"%.1f\">", kTitle, width,
                      canvas.height());
    text += drive_picture(drive, *drives[i].result, total, canvas) + "</svg></g>\n";
  }
  return text + "</svg>\n";
}

}  // namespace blindcorner
