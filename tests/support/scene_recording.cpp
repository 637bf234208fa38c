// SPDX-License-Identifier: Apache-2.0
#include "support/scene_recording.hpp"

#include <fmt/format.h>

#include <fstream>
#include <set>

#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/record/writer.hpp"
#include "support/scene_shapes.hpp"

namespace sightline::test {
namespace {

Status written(std::ofstream& out, const std::filesystem::path& path) {
  out.close();
  if (out) return {};
  return make_error(ErrorCode::kIo, path.string(), "cannot write it");
}

void write_pose(Time time, const std::string& name, const Rigid3& pose, std::ostream& out) {
  Eigen::Quaterniond q = pose.rotation;
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const Eigen::Vector3d& t = pose.translation;
  out << fmt::format("{},{},{:.9f},{:.9f},{:.9f},{:.12f},{:.12f},{:.12f},{:.12f}\n", to_ns(time),
                     name, t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z());
}

Status write_truth(const SceneRig& rig, const std::vector<RecordedBody>& others,
                   const std::filesystem::path& path) {
  std::set<Time> times;
  for (const SceneShot& shot : rig.shots()) times.insert(shot.true_capture);
  std::ofstream out(path);
  out << "t_ns,object,tx,ty,tz,qw,qx,qy,qz\n";
  for (const Time time : times) {
    write_pose(time, rig.options().name, rig.truth(time), out);
    for (const RecordedBody& other : others) write_pose(time, other.name, other.path(time), out);
  }
  return written(out, path);
}

Status write_visibility(const SceneRig& rig, const std::filesystem::path& path) {
  std::ofstream out(path);
  out << "camera,index,object,visible_fraction\n";
  for (const SceneShot& shot : rig.shots()) {
    out << fmt::format("{},{},{},{:.3f}\n", rig.cameras()[static_cast<size_t>(shot.camera)].name,
                       shot.sequence, rig.options().name, rig.visible_share(shot));
  }
  return written(out, path);
}

}  // namespace

Status write_scene_recording(const SceneRig& rig, const std::filesystem::path& folder,
                             Symmetry symmetry, const std::vector<RecordedBody>& others) {
  const std::filesystem::path parts = folder.string() + ".parts";
  std::error_code ignored;
  std::filesystem::create_directories(parts, ignored);
  RecordingWriterOptions options;
  SL_ASSIGN(const auto object,
            write_object(parts, rig.options().name, rig.options().shape->mesh(), symmetry));
  options.objects = {object};
  for (const RecordedBody& other : others) {
    SL_ASSIGN(const auto file,
              write_object(parts, other.name, other.shape->mesh(), other.symmetry));
    options.objects.push_back(file);
  }
  options.calibration_toml = format_calibration(rig.cameras());
  options.raw_storage = RawStorage::kFfv1;
  for (const CalibratedCamera& camera : rig.cameras()) {
    options.cameras.push_back(
        {camera.name, PixelFormat::kI420, camera.model.width(), camera.model.height()});
  }
  SL_ASSIGN(auto writer, RecordingWriter::create(folder, options));
  std::filesystem::remove_all(parts, ignored);
  for (const SceneShot& shot : rig.shots()) SL_RETURN_IF_ERROR(writer->append(*rig.shoot(shot)));
  SL_RETURN_IF_ERROR(writer->close());
  SL_RETURN_IF_ERROR(write_truth(rig, others, folder / "truth.csv"));
  return write_visibility(rig, folder / "visibility.csv");
}

}  // namespace sightline::test
