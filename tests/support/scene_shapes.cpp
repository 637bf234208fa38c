// SPDX-License-Identifier: Apache-2.0
#include "support/scene_shapes.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <map>
#include <numbers>

namespace sightline::test {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
using Eigen::Vector3d;
using Eigen::Vector3f;

TriangleMesh finished(TriangleMesh mesh, const char* name, float crease) {
  MeshOptions options;
  options.crease_angle = crease;
  return finish_mesh(std::move(mesh), name, options).value();
}

/// A closed surface over latitude (0 at +z .. 1 at -z) and longitude (0..1).
TriangleMesh globe(size_t faces, const std::function<Vector3d(double, double)>& point) {
  const auto rings = std::max<size_t>(
      4, static_cast<size_t>(std::lround(std::sqrt(static_cast<double>(faces)) / 2)));
  const size_t around = std::max<size_t>(6, faces / (2 * rings));
  TriangleMesh mesh;
  mesh.vertices.push_back(point(0, 0).cast<float>());
  for (size_t i = 1; i < rings; ++i) {
    for (size_t k = 0; k < around; ++k) {
      mesh.vertices.push_back(point(static_cast<double>(i) / static_cast<double>(rings),
                                    static_cast<double>(k) / static_cast<double>(around))
                                  .cast<float>());
    }
  }
  mesh.vertices.push_back(point(1, 0).cast<float>());
  const auto last = static_cast<uint32_t>(mesh.vertices.size() - 1);
  const auto at = [&](size_t ring, size_t k) {
    return static_cast<uint32_t>(1 + (ring - 1) * around + k % around);
  };
  for (size_t k = 0; k < around; ++k) {
    mesh.faces.push_back({0, at(1, k), at(1, k + 1)});
    for (size_t i = 1; i + 1 < rings; ++i) {
      mesh.faces.push_back({at(i, k), at(i + 1, k), at(i + 1, k + 1)});
      mesh.faces.push_back({at(i, k), at(i + 1, k + 1), at(i, k + 1)});
    }
    mesh.faces.push_back({at(rings - 1, k), last, at(rings - 1, k + 1)});
  }
  return mesh;
}

Vector3d direction_of(double latitude, double longitude) {
  const double theta = std::numbers::pi * latitude, phi = kTurn * longitude;
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

void append(TriangleMesh& mesh, const TriangleMesh& part, const Vector3f& middle,
            const Vector3f& color) {
  const auto base = static_cast<uint32_t>(mesh.vertices.size());
  for (const Vector3f& v : part.vertices) mesh.vertices.push_back(v + middle);
  for (const auto& f : part.faces) {
    mesh.faces.push_back({f[0] + base, f[1] + base, f[2] + base});
    mesh.face_colors.push_back(color);
  }
}

/// A wheel about y.
TriangleMesh make_wheel(float radius, float width) {
  constexpr uint32_t kSides = 24;
  TriangleMesh mesh;
  for (uint32_t i = 0; i < kSides; ++i) {
    const auto angle = static_cast<float>(kTurn * i / kSides);
    for (const float y : {-0.5f, 0.5f}) {
      mesh.vertices.emplace_back(radius * std::cos(angle), y * width, radius * std::sin(angle));
    }
  }
  mesh.vertices.emplace_back(0, -0.5f * width, 0);
  mesh.vertices.emplace_back(0, 0.5f * width, 0);
  for (uint32_t i = 0; i < kSides; ++i) {
    const uint32_t a = 2 * i, b = 2 * ((i + 1) % kSides);
    mesh.faces.push_back({a, a + 1, b + 1});
    mesh.faces.push_back({a, b + 1, b});
    mesh.faces.push_back({2 * kSides, a, b});
    mesh.faces.push_back({2 * kSides + 1, b + 1, a + 1});
  }
  return mesh;
}

}  // namespace

TriangleMesh make_creature(size_t faces) {
  struct Lump {
    Vector3d toward;
    double height, width;  // height as a share of the body, width [rad]
  };
  const Lump lumps[] = {
      {{1.0, 0.10, 0.55}, 1.05, 0.30},   {{0.8, -0.05, 0.95}, 0.55, 0.22},
      {{-1.0, 0.05, 0.15}, 1.25, 0.26},  {{-0.9, -0.3, 0.5}, 0.45, 0.18},
      {{0.05, 0.9, 0.75}, 0.75, 0.28},   {{-0.1, -0.9, 0.65}, 0.65, 0.24},
      {{0.55, 0.45, -0.85}, 0.55, 0.20}, {{0.5, -0.5, -0.85}, 0.55, 0.20},
      {{-0.5, 0.45, -0.9}, 0.50, 0.22},  {{-0.45, -0.4, -0.9}, 0.60, 0.18},
      {{0.0, 0.1, 1.0}, 0.35, 0.16},
  };
  const auto radius = [&](const Vector3d& n) {
    double r = 1 + 0.06 * std::sin(9 * n.x() + 2) * std::sin(8 * n.y()) * std::sin(7 * n.z() + 1);
    for (const Lump& lump : lumps) {
      const double angle = std::acos(std::clamp(n.dot(lump.toward.normalized()), -1.0, 1.0));
      r += lump.height * std::exp(-0.5 * angle * angle / (lump.width * lump.width));
    }
    return r;
  };
  TriangleMesh mesh = globe(faces, [&](double latitude, double longitude) {
    const Vector3d n = direction_of(latitude, longitude);
    return Vector3d(radius(n) * n);
  });
  Vector3f low = Vector3f::Constant(1e9f), high = -low;
  for (const Vector3f& v : mesh.vertices) low = low.cwiseMin(v), high = high.cwiseMax(v);
  const Vector3f scale = Vector3f(0.103f, 0.046f, 0.072f).cwiseQuotient(high - low);
  for (Vector3f& v : mesh.vertices) v = (v - 0.5f * (low + high)).cwiseProduct(scale);
  return finished(std::move(mesh), "make_creature", 1.2f);
}

TriangleMesh make_truck() {
  TriangleMesh mesh;
  const Vector3f red(0.62f, 0.06f, 0.05f), gray(0.35f, 0.37f, 0.40f), dark(0.03f, 0.03f, 0.035f),
      blue(0.05f, 0.12f, 0.40f), glass(0.10f, 0.20f, 0.26f);
  append(mesh, make_box({0.150f, 0.060f, 0.014f}), {0, 0, -0.018f}, gray);
  append(mesh, make_box({0.044f, 0.064f, 0.050f}), {0.050f, 0, 0.0142f}, red);
  append(mesh, make_box({0.022f, 0.058f, 0.018f}), {0.0605f, 0, 0.0302f}, glass);
  append(mesh, make_box({0.092f, 0.072f, 0.044f}), {-0.029f, 0, 0.0115f}, blue);
  append(mesh, make_box({0.010f, 0.070f, 0.012f}), {0.0785f, 0, -0.017f}, dark);
  for (const float x : {-0.048f, 0.046f}) {
    for (const float y : {-0.034f, 0.034f}) {
      append(mesh, make_wheel(0.0165f, 0.014f), {x, y, -0.0262f}, dark);
    }
  }
  return finished(std::move(mesh), "make_truck", 0.6f);
}

TriangleMesh make_bottle(size_t faces) {
  const auto radius = [](double along) {  // along: 0 at the top .. 1 at the bottom
    const double shoulder = 1 / (1 + std::exp(-(along - 0.30) / 0.035));
    const double collar = 0.004 * std::exp(-0.5 * std::pow((along - 0.07) / 0.02, 2));
    const double waist = 0.0035 * std::exp(-0.5 * std::pow((along - 0.68) / 0.07, 2));
    return 0.0115 + 0.0185 * shoulder + collar - waist;
  };
  TriangleMesh mesh = globe(faces, [&](double latitude, double longitude) {
    constexpr double kCap = 0.06;  // of the latitudes, for each flat end
    const double along = std::clamp((latitude - kCap) / (1 - 2 * kCap), 0.0, 1.0);
    const double end = std::clamp(std::min(latitude, 1 - latitude) / kCap, 0.0, 1.0);
    const double r = end * radius(along), phi = kTurn * longitude;
    return Vector3d(r * std::cos(phi), r * std::sin(phi), 0.170 * (0.5 - along));
  });
  return finished(std::move(mesh), "make_bottle", 0.6f);
}

TriangleMesh make_bracket() {
  // The outline of an L in x and z; corner 3 is the inner one, from which every other is seen.
  const Eigen::Vector2f outline[] = {{-0.045f, -0.035f}, {0.045f, -0.035f}, {0.045f, -0.023f},
                                     {-0.031f, -0.023f}, {-0.031f, 0.035f}, {-0.045f, 0.035f}};
  constexpr uint32_t kCorners = 6, kInner = 3;
  TriangleMesh mesh;
  for (const float y : {-0.030f, 0.030f}) {
    for (const auto& p : outline) mesh.vertices.emplace_back(p.x(), y, p.y());
  }
  for (uint32_t i = 0; i < kCorners; ++i) {
    const uint32_t k = (i + 1) % kCorners;
    mesh.faces.push_back({i, k + kCorners, k});
    mesh.faces.push_back({i, i + kCorners, k + kCorners});
    if (i == kInner || k == kInner) continue;
    mesh.faces.push_back({kInner, i, k});
    mesh.faces.push_back({kInner + kCorners, k + kCorners, i + kCorners});
  }
  return finished(std::move(mesh), "make_bracket", 0.6f);
}

TriangleMesh make_carton() { return make_box({0.110f, 0.070f, 0.045f}); }

Status write_obj(const std::filesystem::path& path, const TriangleMesh& mesh) {
  std::filesystem::path materials = path;
  materials.replace_extension(".mtl");
  std::ofstream out(path), mtl(materials);
  out << "# SPDX-License-Identifier: Apache-2.0\n";
  if (!mesh.face_colors.empty()) out << "mtllib " << materials.filename().string() << "\n";
  for (const Vector3f& v : mesh.vertices) {
    out << fmt::format("v {:.9g} {:.9g} {:.9g}\n", v.x(), v.y(), v.z());
  }
  std::map<std::array<float, 3>, size_t> known;
  size_t used = SIZE_MAX;
  for (size_t i = 0; i < mesh.faces.size(); ++i) {
    if (!mesh.face_colors.empty()) {
      const Vector3f& c = mesh.face_colors[i];
      const auto [entry, fresh] = known.try_emplace({c.x(), c.y(), c.z()}, known.size());
      if (fresh) {
        mtl << fmt::format("newmtl c{}\nKd {} {} {}\n", entry->second, c.x(), c.y(), c.z());
      }
      if (entry->second != used) out << fmt::format("usemtl c{}\n", entry->second);
      used = entry->second;
    }
    const auto& f = mesh.faces[i];
    out << fmt::format("f {} {} {}\n", f[0] + 1, f[1] + 1, f[2] + 1);
  }
  out.close();
  mtl.close();
  if (out && mtl) return {};
  return make_error(ErrorCode::kIo, path.string(), "cannot write the mesh");
}

Result<std::filesystem::path> write_object(const std::filesystem::path& folder,
                                           const std::string& name, const TriangleMesh& mesh,
                                           Symmetry symmetry, int order) {
  SL_RETURN_IF_ERROR(write_obj(folder / (name + ".obj"), mesh));
  const std::filesystem::path file = folder / (name + ".toml");
  std::ofstream out(file);
  out << fmt::format("name = \"{}\"\nmesh = \"{}.obj\"\nunit = \"m\"\n", name, name);
  if (symmetry == Symmetry::kAxis) out << "symmetry = \"axis\"\nsymmetry_axis = [0, 0, 1]\n";
  if (symmetry == Symmetry::kDiscrete) {
    out << fmt::format("symmetry = \"discrete\"\nsymmetry_axis = [0, 0, 1]\nsymmetry_order = {}\n",
                       order);
  }
  out.close();
  if (out) return file;
  return make_error(ErrorCode::kIo, file.string(), "cannot write the object file");
}

TriangleMesh make_column_with_box(const Eigen::Vector3f& box_middle,
                                  const Eigen::Vector3f& box_size) {
  constexpr uint32_t kSides = 48;
  TriangleMesh mesh = make_box(box_size);
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex += box_middle;
  const auto base = static_cast<uint32_t>(mesh.vertices.size());
  for (uint32_t i = 0; i < 2 * kSides; ++i) {
    const auto angle = static_cast<float>(2 * std::numbers::pi * (i % kSides) / kSides);
    mesh.vertices.emplace_back(0.03f * std::cos(angle), 0.03f * std::sin(angle),
                               i < kSides ? -0.05f : 0.05f);
  }
  for (uint32_t i = 0; i < kSides; ++i) {
    const uint32_t k = (i + 1) % kSides;
    mesh.faces.push_back({base + i, base + k, base + kSides + k});
    mesh.faces.push_back({base + i, base + kSides + k, base + kSides + i});
    if (i > 0 && k != 0) {
      mesh.faces.push_back({base, base + k, base + i});
      mesh.faces.push_back({base + kSides, base + kSides + i, base + kSides + k});
    }
  }
  mesh.normals.clear();
  mesh.face_normals.clear();
  return finish_mesh(std::move(mesh), "column").value();
}

TriangleMesh make_colored_carton() {
  TriangleMesh mesh = make_carton();
  mesh.face_colors.clear();
  for (const auto& face : mesh.faces) {
    const Vector3f& p = mesh.vertices[face[0]];
    const Vector3f normal =
        (mesh.vertices[face[1]] - p).cross(mesh.vertices[face[2]] - p).normalized();
    mesh.face_colors.push_back((Vector3f::Constant(0.45f) + 0.4f * normal).cwiseMax(0.05f));
  }
  return mesh;
}

}  // namespace sightline::test
