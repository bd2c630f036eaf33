// SPDX-License-Identifier: Apache-2.0
#include "forward/relay/ray_scene.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// Share of a segment's length at either end in which nothing blocks it. A ray in single precision
/// needs this much to leave its own surface.
constexpr float kEndTolerance = 1e-4F;

void throw_on_error(void* /*user*/, RTCError code, const char* message) {
  throw Error("ray tracing", "code " + std::to_string(static_cast<int>(code)) + ", " +
                                 (message != nullptr ? message : "no message"));
}

/// `origin` is relative to RayScene::Impl::origin.
void set_ray(RTCRay& ray, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
             float near, float far) {
  ray.org_x = static_cast<float>(origin.x());
  ray.org_y = static_cast<float>(origin.y());
  ray.org_z = static_cast<float>(origin.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tnear = near;
  ray.tfar = far;
  ray.time = 0;
  ray.mask = 0xFFFFFFFFU;
  ray.flags = 0;
}

}  // namespace

struct RayScene::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  /// Origin of Embree's coordinates, m, world. At 100 km from it, single precision resolves 1 cm.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();

  ~Impl() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }

  void add(unsigned id, const std::vector<Triangle>& triangles) const {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    const std::size_t count = triangles.size();
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), 3 * count));
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), count));
    for (std::size_t t = 0; t < count; ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        for (int axis = 0; axis < 3; ++axis) {
          vertices[9 * t + 3 * k + static_cast<std::size_t>(axis)] =
              static_cast<float>(triangles[t][k][axis] - origin[axis]);
        }
        indices[3 * t + k] = static_cast<unsigned>(3 * t + k);
      }
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, id);
    rtcReleaseGeometry(geometry);
  }
};

namespace {

std::vector<std::vector<Triangle>> bodies_of(const std::vector<Surface>& surfaces) {
  std::vector<std::vector<Triangle>> bodies;
  for (const Surface& surface : surfaces) {
    bodies.push_back(triangulate(surface.shape, surface.T_world_surface, 1.0));
  }
  return bodies;
}

}  // namespace

RayScene::RayScene(const std::vector<Surface>& surfaces) : RayScene(bodies_of(surfaces)) {}

RayScene::RayScene(const std::vector<std::vector<Triangle>>& bodies)
    : impl_(std::make_unique<Impl>()) {
  impl_->device = rtcNewDevice(nullptr);
  if (impl_->device == nullptr) throw Error("ray tracing", "no device could be made");
  rtcSetDeviceErrorFunction(impl_->device, throw_on_error, nullptr);
  impl_->scene = rtcNewScene(impl_->device);
  rtcSetSceneFlags(impl_->scene, RTC_SCENE_FLAG_ROBUST);
  Eigen::AlignedBox3d box;
  for (const auto& body : bodies) {
    for (const Triangle& triangle : body) {
      for (const Eigen::Vector3d& corner : triangle) box.extend(corner);
    }
  }
  if (!box.isEmpty()) {
    // Bodies around the world's origin gain no precision from another origin.
    const Eigen::Vector3d center = box.center();
    if (center.norm() > box.diagonal().norm() / 2) impl_->origin = center;
  }
  for (std::size_t i = 0; i < bodies.size(); ++i) impl_->add(static_cast<unsigned>(i), bodies[i]);
  rtcCommitScene(impl_->scene);
}

RayScene::~RayScene() = default;

std::optional<RayHit> RayScene::first_hit(const Eigen::Vector3d& origin,
                                          const Eigen::Vector3d& direction) const {
  const Eigen::Vector3d unit = direction.normalized();
  RTCRayHit query{};
  set_ray(query.ray, origin - impl_->origin, unit, 0.0F, std::numeric_limits<float>::infinity());
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if RTC_VERSION_MAJOR >= 4
  rtcIntersect1(impl_->scene, &query);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(impl_->scene, &context, &query);
#endif
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  RayHit hit;
  hit.surface = static_cast<int>(query.hit.geomID);
  hit.distance = static_cast<double>(query.ray.tfar);
  hit.point = origin + hit.distance * unit;
  hit.normal =
      Eigen::Vector3d(static_cast<double>(query.hit.Ng_x), static_cast<double>(query.hit.Ng_y),
                      static_cast<double>(query.hit.Ng_z))
          .normalized();
  return hit;
}

bool RayScene::blocked(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const {
  RTCRay ray{};
  set_ray(ray, from - impl_->origin, to - from, kEndTolerance, 1.0F - kEndTolerance);
#if RTC_VERSION_MAJOR >= 4
  rtcOccluded1(impl_->scene, &ray);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(impl_->scene, &context, &ray);
#endif
  return ray.tfar < 0;
}

}  // namespace blindcorner
