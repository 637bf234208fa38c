// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace sightline::cli {

/// The commands of `sightline`. Each prints to stdout what was asked for, to stderr what went
/// wrong, and returns the exit status (DESIGN section 5).

struct CheckOptions {
  std::filesystem::path file;
  bool json = false;
};
int check(const CheckOptions& options);

struct EvaluateCommandOptions {
  std::filesystem::path truth;
  std::filesystem::path poses;
  std::vector<std::filesystem::path> object_files;  ///< whose symmetry counts
  bool json = false;
};
int evaluate(const EvaluateCommandOptions& options);

struct ReplayOptions {
  std::filesystem::path recording;
  std::filesystem::path config;       ///< empty: what the recording says
  std::vector<std::string> cues;      ///< of every object; empty: what its file says
  std::vector<std::string> features;  ///< OBJECT=FILE, or FILE for all: taught ones, instead
  std::filesystem::path poses;        ///< empty: none
  std::filesystem::path overlay;      ///< folder of videos; empty: none
  std::filesystem::path overlay_png;  ///< folder of pictures; empty: none
  std::filesystem::path points;       ///< PLY of stereo points; empty: none
  bool realtime = false;
  bool json = false;
};
int replay(const ReplayOptions& options);

struct TeachCommandOptions {
  std::filesystem::path input;        ///< recording, or list of pictures
  std::filesystem::path out;          ///< the feature file
  std::filesystem::path poses;        ///< truth.csv or a pose log; empty: the recording's own
  std::filesystem::path calibration;  ///< of the list's cameras
  std::string object;  ///< of the recording (empty: its only one); for a list its file
  std::vector<std::string> cameras;  ///< empty: all
  int every = 5;                     ///< pictures of a camera
  double from_s = 0, to_s = 1e9;     ///< of the recording
  bool json = false;
};
int teach(const TeachCommandOptions& options);

struct RecordOptions {
  std::filesystem::path config;
  std::filesystem::path out;
  std::optional<double> seconds;  ///< stop by itself
};
int record(const RecordOptions& options);

struct CamerasOptions {
  std::string source;             ///< to be tried; empty: list what is plugged in
  std::vector<std::string> sync;  ///< two sources whose timing is compared; or empty
  std::filesystem::path config;   ///< then sources are the names of cameras in it
  std::filesystem::path save;     ///< PNG of the newest frame
  double seconds = 5;
  bool json = false;
};
int cameras(const CamerasOptions& options);

struct ModelOptions {
  std::filesystem::path file;   ///< object file, or mesh
  double meters_per_unit = 1;   ///< of a mesh
  std::filesystem::path cache;  ///< folder; empty: the user's
  bool no_cache = false;
  std::filesystem::path sheet;  ///< contact sheet (PNG); empty: none
  bool json = false;
};
int model(const ModelOptions& options);

struct SuperimposeOptions {
  std::vector<std::string> points;    ///< FILE, edges:FILE, corners:FILE
  std::string from;                   ///< camera whose frame the points are in
  std::string to;                     ///< camera of the picture
  std::string points_frame = "from";  ///< or "world", or "to"
  std::filesystem::path image, out;
  std::filesystem::path table;       ///< CSV; empty: to stdout
  std::string marker = "rectangle";  ///< or "circle", or "none"
  std::filesystem::path mesh;        ///< empty: none
  std::vector<double> pose;          ///< of the mesh, in the frame of the points
  std::vector<std::string> style = {"fill", "outline", "wireframe"};  ///< of the mesh
  std::vector<std::filesystem::path> scene;                           ///< meshes in the world
  double points_unit = 1, camera_unit = 1, mesh_unit = 1;             ///< [m]
  bool skip_behind = false;
  bool json = false;
};
int superimpose(const SuperimposeOptions& options);

struct ViewOptions {
  std::filesystem::path recording;
  std::filesystem::path config;         ///< empty: what the recording says
  std::filesystem::path out;            ///< .png or .mkv
  std::string name;                     ///< of a [[view]] in the installation; empty: as follows
  std::vector<double> eye, target, up;  ///< empty or 3 numbers [m]
  double fov_deg = 50;
  int width = 1280, height = 720;
  std::optional<double> at_s;  ///< since the start of the recording; unset: to its end
  bool json = false;
};
int view(const ViewOptions& options);

}  // namespace sightline::cli
