// SPDX-License-Identifier: Apache-2.0
// Five ways to find hidden surfaces, on what a camera needs to know of the marked object: which of
// its pixels are seen (docs/hidden_surfaces.md). For comparison only; the product draws with
// render/raster.
#include <fmt/format.h>
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "hidden_surfaces/exact.hpp"
#include "hidden_surfaces/method.hpp"

namespace {

using namespace sightline;
using namespace sightline::hidden_surfaces;
using Json = nlohmann::ordered_json;

struct Options {
  std::string meshes = SIGHTLINE_SOURCE_DIR "/tests/geometry/meshes", picture;
  bool quick = false, json = false;
};

struct Figures {
  double prepare_ms = 0, draw_ms = 0;
  size_t bytes = 0, wrong = 0, seen = 0;  ///< seen: pixels of A
};

double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

// The least of several runs, as many as fit in a second.
template <typename Run>
double least_ms(const Run& run, bool quick) {
  double least = std::numeric_limits<double>::infinity(), sum = 0;
  for (int i = 0; i < (quick ? 1 : 20) && sum < 1000; ++i) {
    const double start = cpu_ms();
    run();
    const double took = cpu_ms() - start;
    least = std::min(least, took);
    sum += took;
  }
  return least;
}

Figures measure(Method& method, const Scene& scene, Picture& drawn, bool quick) {
  Figures figures;
  figures.prepare_ms = least_ms([&] { method.prepare(scene); }, quick);
  figures.draw_ms = least_ms(
      [&] {
        drawn = Picture(scene.tile());
        method.draw(scene, drawn);
      },
      quick);
  figures.bytes = method.bytes();
  return figures;
}

cv::Vec3b color_of(const Scene& scene, const Picture& picture, int x, int y) {
  const int32_t index = picture.at(x, y);
  if (index < 0) return {32, 32, 32};
  const Face& face = scene.faces[static_cast<size_t>(index)];
  const Eigen::Vector3d to_eye = -face.corner[0].normalized();
  const double light = 0.35 + 0.65 * std::max(0.0, face.plane().normal.normalized().dot(to_eye));
  const Eigen::Vector3d paint =
      face.owner == 0 ? Eigen::Vector3d(60, 160, 250) : Eigen::Vector3d(190, 180, 170);
  const Eigen::Vector3d shade = paint * light;
  return {cv::saturate_cast<uchar>(shade.x()), cv::saturate_cast<uchar>(shade.y()),
          cv::saturate_cast<uchar>(shade.z())};
}

// One picture of the sheet, with the wrong pixels in red.
cv::Mat panel(const Scene& scene, const Picture& drawn, Picture& exact) {
  constexpr int kSide = 240;
  const Tile& tile = drawn.tile;
  cv::Mat image(tile.height, tile.width, CV_8UC3);
  for (int y = 0; y < tile.height; ++y) {
    for (int x = 0; x < tile.width; ++x) {
      image.at<cv::Vec3b>(y, x) = color_of(scene, drawn, tile.x + x, tile.y + y);
    }
  }
  wrong_pixels(scene, drawn, exact, [&](int x, int y) {
    image.at<cv::Vec3b>(y - tile.y, x - tile.x) = {40, 0, 255};
  });
  const double scale = std::min(double(kSide) / tile.width, double(kSide) / tile.height);
  cv::resize(image, image, {}, scale, scale, cv::INTER_NEAREST);
  cv::Mat out(kSide, kSide, CV_8UC3, cv::Scalar(32, 32, 32));
  image.copyTo(
      out(cv::Rect((kSide - image.cols) / 2, (kSide - image.rows) / 2, image.cols, image.rows)));
  return out;
}

void label(cv::Mat& image, const std::string& text) {
  cv::putText(image, text, {8, 18}, cv::FONT_HERSHEY_SIMPLEX, 0.42, {255, 255, 255}, 1,
              cv::LINE_AA);
}

Json compare(const Options& options, cv::Mat& sheet) {
  Json rows = Json::array();
  for (const char* name : {"barn", "torus", "10k", "100k", "pierced"}) {
    const Scene scene = make_scene(name, options.meshes);
    Picture exact = exact_picture(scene);
    cv::Mat line;
    for (const auto& method : all_methods()) {
      Picture drawn(scene.tile());
      Figures figures = measure(*method, scene, drawn, options.quick);
      figures.wrong = wrong_pixels(scene, drawn, exact);
      for (const int32_t face : exact.face) {
        figures.seen += face >= 0 && scene.faces[static_cast<size_t>(face)].owner == 0 ? 1 : 0;
      }
      cv::Mat one = panel(scene, drawn, exact);
      label(one, fmt::format("{}, {}: {} wrong", name, method->name(), figures.wrong));
      if (line.empty()) {
        line = one;
      } else {
        cv::hconcat(line, one, line);
      }
      rows.push_back({{"scene", name},
                      {"faces", scene.faces.size()},
                      {"method", method->name()},
                      {"seen_px", figures.seen},
                      {"wrong_px", figures.wrong},
                      {"prepare_ms", figures.prepare_ms},
                      {"draw_ms", figures.draw_ms},
                      {"kib", static_cast<double>(figures.bytes) / 1024}});
    }
    if (sheet.empty()) {
      sheet = line;
    } else {
      cv::vconcat(sheet, line, sheet);
    }
  }
  return rows;
}

// By how much the cost grows: the exponent between two sizes.
Json growth(const Options& options, bool by_faces) {
  Json rows = Json::array();
  const std::vector<double> sizes = by_faces ? std::vector<double>{1000, 3000, 10'000, 30'000}
                                             : std::vector<double>{64, 128, 256, 512};
  for (const auto& method : all_methods()) {
    std::vector<double> total;
    Json costs = Json::array();
    for (const double size : sizes) {
      const Scene scene = by_faces ? make_torus_scene("", static_cast<size_t>(size), 256)
                                   : make_torus_scene("", 10'000, size);
      Picture drawn(scene.tile());
      const Figures figures = measure(*method, scene, drawn, options.quick);
      total.push_back(by_faces ? figures.prepare_ms + figures.draw_ms : figures.draw_ms);
      costs.push_back(total.back());
    }
    const double exponent =
        std::log(total.back() / total.front()) / std::log(sizes.back() / sizes.front());
    rows.push_back({{"method", method->name()},
                    {by_faces ? "faces" : "width_px", sizes},
                    {"ms", costs},
                    {"exponent", exponent}});
  }
  return rows;
}

void print_growth(const Json& rows, const char* sizes) {
  for (const Json& row : rows) {
    fmt::print("| {} |", row["method"].get<std::string>());
    for (const Json& ms : row["ms"]) fmt::print(" {:.2f} |", ms.get<double>());
    fmt::print(" {:.2f} |\n", row["exponent"].get<double>());
  }
  fmt::print("({}: {})\n\n", sizes, rows[0][sizes].dump());
}

void print(const Json& all) {
  fmt::print(
      "| scene | faces | method | wrong pixels of seen | prepare | draw | memory |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n");
  for (const Json& row : all["scenes"]) {
    fmt::print("| {} | {} | {} | {} of {} | {:.2f} ms | {:.2f} ms | {:.0f} KiB |\n",
               row["scene"].get<std::string>(), row["faces"].get<size_t>(),
               row["method"].get<std::string>(), row["wrong_px"].get<size_t>(),
               row["seen_px"].get<size_t>(), row["prepare_ms"].get<double>(),
               row["draw_ms"].get<double>(), row["kib"].get<double>());
  }
  fmt::print("\n");
  print_growth(all["by_faces"], "faces");
  print_growth(all["by_width"], "width_px");
  fmt::print("exact rays: {}\n", all["exact"].get<std::string>());
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"Five ways to find hidden surfaces, compared"};
  app.add_option("--picture", options.picture, "PNG of what each draws, wrong pixels in red");
  app.add_option("--meshes", options.meshes, "folder with barn.3vn");
  app.add_flag("--quick", options.quick, "one run of each");
  app.add_flag("--json", options.json, "as JSON");
  CLI11_PARSE(app, argc, argv);
  cv::Mat sheet;
  Json all;
  all["exact"] = exact_has_embree() ? "Embree, checked in double" : "every face, in double";
  all["scenes"] = compare(options, sheet);
  all["by_faces"] = growth(options, true);
  all["by_width"] = growth(options, false);
  if (!options.picture.empty() &&
      !cv::imwrite(options.picture, sheet, {cv::IMWRITE_PNG_COMPRESSION, 9})) {
    fmt::print(stderr, "hidden_surfaces: cannot write {}\n", options.picture);
    return 1;
  }
  if (options.json) {
    fmt::print("{}\n", all.dump(2));
  } else {
    print(all);
  }
  return 0;
}
