// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/known_patches.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "forward/support/multiversion.h"

namespace blindcorner {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Height of a patch over its surface relative to its distance: a hundred times the precision of a
/// ray.
constexpr double kLift = 1e-5;
/// Least cosine between the normals of cells on one plane: far above rounding.
constexpr double kParallel = 1 - 1e-9;

double longer_edge(const SurfaceCell& cell) {
  return 2 * std::max(cell.half_u.norm(), cell.half_v.norm());
}

/// Weights with both cosines, paths and their spreads, without shadows.
///
/// A and B are the distance times either cosine, R is the distance squared. The mean of A B / R^2
/// over patches of half edges h differs from its value between their centres by the second
/// derivatives, with q = d h / R: A B / R^2 sum (4 q^2 - 2 h^2 / 3 R) - 4 / 3 R^2 (B sum q h n + A
/// sum q h m). A negative difference divides instead, so that nothing becomes negative where
/// patches meet.
BLINDCORNER_MULTIVERSION void open_legs(const SurfaceCell& cell, const KnownPatches& p,
                                        KnownLegs& legs) {
  const double cx = cell.center.x(), cy = cell.center.y(), cz = cell.center.z();
  const double nx = cell.normal.x(), ny = cell.normal.y(), nz = cell.normal.z();
  const double kx = cell.half_u.x(), ky = cell.half_u.y(), kz = cell.half_u.z();
  const double lx = cell.half_v.x(), ly = cell.half_v.y(), lz = cell.half_v.z();
  const double own = cell.half_u.squaredNorm() + cell.half_v.squaredNorm();
  const std::size_t count = p.size();
  const double *px = p.c[0].data(), *py = p.c[1].data(), *pz = p.c[2].data();
  const double *mx = p.n[0].data(), *my = p.n[1].data(), *mz = p.n[2].data();
  const double *ux = p.u[0].data(), *uy = p.u[1].data(), *uz = p.u[2].data();
  const double *vx = p.v[0].data(), *vy = p.v[1].data(), *vz = p.v[2].data();
  const double *gx = p.g[0].data(), *gy = p.g[1].data(), *gz = p.g[2].data();
  const double *w = p.weight.data(), *leg = p.leg.data(), *extent = p.extent.data();
  double *weight = legs.weight.data(), *length = legs.length.data();
  double *x = legs.x.data(), *y = legs.y.data(), *z = legs.z.data();
  double *du = legs.du.data(), *dv = legs.dv.data();
  BLINDCORNER_INDEPENDENT
  for (std::size_t i = 0; i < count; ++i) {
    const double dx = px[i] - cx, dy = py[i] - cy, dz = pz[i] - cz;
    const double square = dx * dx + dy * dy + dz * dz + 1e-12;
    const double r = std::sqrt(square);
    const double ex = dx / r, ey = dy / r, ez = dz / r;
    const double here = std::max(ex * nx + ey * ny + ez * nz, 0.0);
    const double there = std::max(-(ex * mx[i] + ey * my[i] + ez * mz[i]), 0.0);
    const double eu = ex * ux[i] + ey * uy[i] + ez * uz[i];
    const double ev = ex * vx[i] + ey * vy[i] + ez * vz[i];
    const double ek = ex * kx + ey * ky + ez * kz;
    const double el = ex * lx + ey * ly + ez * lz;
    const double un = ux[i] * nx + uy[i] * ny + uz[i] * nz;
    const double vn = vx[i] * nx + vy[i] * ny + vz[i] * nz;
    const double km = kx * mx[i] + ky * my[i] + kz * mz[i];
    const double lm = lx * mx[i] + ly * my[i] + lz * mz[i];
    const double size = own + extent[i];
    const double even = here * there;
    const double change = even * (4 * (eu * eu + ev * ev + ek * ek + el * el) - 2.0 / 3 * size) -
                          4.0 / 3 * (there * (eu * un + ev * vn) - here * (ek * km + el * lm));
    const double less = std::max(-change, 0.0), more = std::max(change, 0.0);
    const double lessened = even * even * square / (even * square + less + 1e-30);
    weight[i] = even > 0 ? w[i] * (lessened / square + more / (square * (square + size))) : 0.0;
    length[i] = leg[i] + r;
    du[i] = std::abs(gx[i] * ux[i] + gy[i] * uy[i] + gz[i] * uz[i] + eu);
    dv[i] = std::abs(gx[i] * vx[i] + gy[i] * vy[i] + gz[i] * vz[i] + ev);
    x[i] = ex;
    y[i] = ey;
    z[i] = ez;
  }
}

}  // namespace

SurfaceCell cell_of(const RelayPatch& patch) {
  return {patch.center, patch.normal, patch.half_u, patch.half_v,
          4 * patch.half_u.cross(patch.half_v).norm()};
}

void KnownPatches::clear() {
  for (auto* list : {&c, &n, &u, &v, &g}) {
    for (auto& values : *list) values.clear();
  }
  for (auto* list : {&weight, &leg, &extent}) list->clear();
  cells.clear();
  zone.clear();
}

void KnownPatches::add(const SurfaceCell& cell, const Vector3d& gradient, double weight_of_it,
                       double leg_of_it, int zone_of_it) {
  for (Eigen::Index i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(i);
    c[k].push_back(cell.center[i]);
    n[k].push_back(cell.normal[i]);
    u[k].push_back(cell.half_u[i]);
    v[k].push_back(cell.half_v[i]);
    g[k].push_back(gradient[i]);
  }
  weight.push_back(weight_of_it);
  leg.push_back(leg_of_it);
  extent.push_back(cell.half_u.squaredNorm() + cell.half_v.squaredNorm());
  cells.push_back(cell);
  zone.push_back(zone_of_it);
}

void KnownPatches::add(const WeightedPatch& patch, int zone_of_it) {
  // Rays end within single precision of their surface, in front of it or behind it.
  SurfaceCell cell = cell_of(patch.patch);
  cell.center += kLift * patch.patch.distance * patch.patch.normal;
  add(cell, patch.leg_direction, patch.weight, patch.leg, zone_of_it);
}

void KnownPatches::pad() {
  const std::size_t count =
      (c[0].size() + ShadowView::kChunk - 1) / ShadowView::kChunk * ShadowView::kChunk;
  for (auto* list : {&c, &u, &v}) {
    for (auto& values : *list) values.resize(count, 0.0);
  }
}

PatchCoordinates KnownPatches::coordinates() const {
  return {{c[0].data(), c[1].data(), c[2].data()},
          {u[0].data(), u[1].data(), u[2].data()},
          {v[0].data(), v[1].data(), v[2].data()}};
}

void KnownLegs::find(const SurfaceCell& cell, const ShadowView& shadows,
                     const KnownPatches& patches) {
  const std::size_t count = patches.size();
  for (auto* list : {&weight, &length, &x, &y, &z, &du, &dv}) list->resize(count);
  open_legs(cell, patches, *this);
  if (shadows.empty()) return;
  sights.resize(count + ShadowView::kChunk);
  shadows.sights(patches.coordinates(), 0, static_cast<int>(count), sights.data());
  for (std::size_t i = 0; i < count; ++i) {
    if (sights[i] == ShadowView::Sight::clear || weight[i] <= 0) continue;
    if (sights[i] == ShadowView::Sight::hidden) {
      weight[i] = 0;
      continue;
    }
    const SurfaceCell& p = patches.cells[i];
    weight[i] *= shadows.see(p.center, p.half_u, p.half_v).fraction;
  }
}

PatchTree::PatchTree(const KnownPatches& patches, double angle, double sensor_angle)
    : angle_(angle), sensor_angle_(sensor_angle), order_(patches.size()) {
  nodes_.reserve(2 * patches.size());
  // Patches of one zone and plane, in the order in which they come.
  struct Group {
    int zone;
    std::vector<std::size_t> patches;
  };
  std::vector<Group> groups;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const SurfaceCell& cell = patches.cells[i];
    const auto belongs = [&](const Group& group) {
      const SurfaceCell& first = patches.cells[group.patches.front()];
      return group.zone == patches.zone[i] && cell.normal.dot(first.normal) > kParallel &&
             std::abs(first.normal.dot(cell.center - first.center)) <
                 2 * kLift * (patches.leg[i] + patches.leg[group.patches.front()]);
    };
    // Patches come zone by zone, so the search begins at the last group.
    const auto known = std::find_if(groups.rbegin(), groups.rend(), belongs);
    if (known != groups.rend()) {
      known->patches.push_back(i);
    } else {
      groups.push_back({patches.zone[i], {i}});
    }
  }
  std::size_t begin = 0;
  for (const Group& group : groups) {
    std::ranges::copy(group.patches, order_.begin() + static_cast<std::ptrdiff_t>(begin));
    const std::size_t end = begin + group.patches.size();
    roots_.push_back(nodes_.size());
    nodes_.emplace_back();
    build(patches, begin, end, roots_.back());
    begin = end;
  }
}

PatchTree::Node PatchTree::sum_of(const KnownPatches& patches, std::size_t begin,
                                  std::size_t end) const {
  Node node;
  const std::size_t any = order_[begin];
  node.cell = patches.cells[any];
  node.zone = patches.zone[any];
  node.begin = begin;
  node.end = end;
  if (end - begin == 1) {
    node.gradient = patches.gradient(any);
    node.weight = patches.weight[any];
    node.leg = patches.leg[any];
    node.edge = longer_edge(node.cell);
    return node;
  }
  Vector3d center = Vector3d::Zero(), gradient = Vector3d::Zero();
  double area = 0, leg = 0;
  for (std::size_t k = begin; k < end; ++k) {
    const std::size_t i = order_[k];
    const double w = patches.weight[i];
    node.weight += w;
    center += w * patches.cells[i].center;
    gradient += w * patches.gradient(i);
    leg += w * patches.leg[i];
    area += patches.cells[i].area;
  }
  node.cell.center = center / node.weight;
  node.cell.area = area;
  node.gradient = gradient / node.weight;
  node.leg = leg / node.weight;
  Matrix3d second = Matrix3d::Zero();
  for (std::size_t k = begin; k < end; ++k) {
    const SurfaceCell& cell = patches.cells[order_[k]];
    const Vector3d way = cell.center - node.cell.center;
    second += patches.weight[order_[k]] / node.weight *
              (way * way.transpose() +
               (cell.half_u * cell.half_u.transpose() + cell.half_v * cell.half_v.transpose()) / 3);
  }
  // The rectangle with the same moments: half edges are sqrt(3) times the standard deviations.
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(second);
  node.cell.half_u =
      std::sqrt(3 * std::max(axes.eigenvalues()[2], 0.0)) * axes.eigenvectors().col(2);
  node.cell.half_v =
      std::sqrt(3 * std::max(axes.eigenvalues()[1], 0.0)) * axes.eigenvectors().col(1);
  node.edge = longer_edge(node.cell);
  if (node.edge > sensor_angle_ * node.leg) node.edge = std::numeric_limits<double>::infinity();
  return node;
}

void PatchTree::build(const KnownPatches& patches, std::size_t begin, std::size_t end,
                      std::size_t at) {
  nodes_[at] = sum_of(patches, begin, end);
  if (end - begin == 1) return;
  // The part is halved at its centre, along its longer axis.
  const Vector3d middle = nodes_[at].cell.center, axis = nodes_[at].cell.half_u;
  const auto first = order_.begin() + static_cast<std::ptrdiff_t>(begin);
  const auto last = order_.begin() + static_cast<std::ptrdiff_t>(end);
  auto half = std::partition(
      first, last, [&](std::size_t i) { return axis.dot(patches.cells[i].center - middle) < 0; });
  if (half == first || half == last) half = first + (last - first) / 2;
  const auto split = static_cast<std::size_t>(half - order_.begin());
  const std::size_t parts = nodes_.size();
  nodes_[at].parts = parts;
  nodes_.emplace_back();
  nodes_.emplace_back();
  build(patches, begin, split, parts);
  build(patches, split, end, parts + 1);
}

/// Whether a part lies behind the plane of a ball's cells, or on it. The half edges are sqrt(3)
/// standard deviations of the light's place, so that at most 1 / (4 sqrt(3))^2 = 2 % of the part's
/// light lies farther from its middle than four times these (Chebyshev).
bool PatchTree::behind(const Ball& ball, const Node& part) {
  if (ball.normal.isZero(0)) return false;
  const double reach =
      std::abs(ball.normal.dot(part.cell.half_u)) + std::abs(ball.normal.dot(part.cell.half_v));
  return ball.normal.dot(part.cell.center - ball.center) + 4 * reach < 4 * kLift * part.leg;
}

void PatchTree::cut(const Ball& ball, KnownPatches& parts) const {
  parts.clear();
  const auto visit = [&](const auto& self, const Node& node) -> void {
    if (behind(ball, node)) return;
    const double distance = (node.cell.center - ball.center).norm() - ball.radius;
    if (node.parts == 0 || node.edge <= angle_ * distance) {
      parts.add(node.cell, node.gradient, node.weight, node.leg, node.zone);
      return;
    }
    self(self, nodes_[node.parts]);
    self(self, nodes_[node.parts + 1]);
  };
  for (const std::size_t root : roots_) {
    const SurfaceCell& plane = nodes_[root].cell;
    if (plane.normal.dot(ball.center - plane.center) + ball.radius > 0) visit(visit, nodes_[root]);
  }
  parts.pad();
}

std::vector<std::vector<std::size_t>> PatchTree::blocks(std::size_t most) const {
  std::vector<std::vector<std::size_t>> blocks;
  const auto visit = [&](const auto& self, const Node& node) -> void {
    if (node.end - node.begin <= most) {
      blocks.emplace_back(order_.begin() + static_cast<std::ptrdiff_t>(node.begin),
                          order_.begin() + static_cast<std::ptrdiff_t>(node.end));
      return;
    }
    self(self, nodes_[node.parts]);
    self(self, nodes_[node.parts + 1]);
  };
  for (const std::size_t root : roots_) visit(visit, nodes_[root]);
  return blocks;
}

Ball ball_around(std::span<const SurfaceCell* const> cells) {
  Ball ball{Vector3d::Zero(), 0};
  for (const SurfaceCell* cell : cells) ball.center += cell->center;
  ball.center /= static_cast<double>(cells.size());
  for (const SurfaceCell* cell : cells) {
    ball.radius = std::max(ball.radius, (cell->center - ball.center).norm());
  }
  const Vector3d& normal = cells.front()->normal;
  const bool flat = std::ranges::all_of(cells, [&](const SurfaceCell* cell) {
    return normal.dot(cell->normal) > kParallel &&
           std::abs(normal.dot(cell->center - ball.center)) < 1e-3 * ball.radius;
  });
  if (flat) ball.normal = normal;
  return ball;
}

}  // namespace blindcorner
