// SPDX-License-Identifier: Apache-2.0
// CPU of one camera through the daemon's own workers, YUYV in, one RTSP viewer in another process,
// against the encoder alone on the same images at the same pace.
//   bench_daemon [--seconds N] [--width W --height H] [--json]
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "sightline/base/thread.hpp"
#include "sightline/base/time.hpp"
#include "sightline/geometry/mesh.hpp"
#include "sightline/image/convert.hpp"
#include "sightline/render/mesh/render_mesh.hpp"
#include "sightline/render/raster/ray_table.hpp"
#include "sightline/render/raster/static_depth.hpp"
#include "workers/camera_worker.hpp"

extern char** environ;

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr double kRate = 30;
constexpr size_t kImages = 16;  // a ring of different images, so that the encoder has work
constexpr size_t kTriangles = 10'000;
constexpr double kFocal = 900;
constexpr double kObjectPx = 256;

// A static mosaic with a moving part and Gaussian sensor noise, packed YUYV.
struct Footage {
  int width, height;
  std::vector<std::shared_ptr<std::vector<uint8_t>>> images;

  Footage(int w, int h) : width(w), height(h) {
    std::mt19937 random(7);
    std::normal_distribution<float> noise(0, 2);
    std::vector<uint8_t> cells(64 * 64);
    for (uint8_t& cell : cells) cell = static_cast<uint8_t>(40 + random() % 160);
    std::vector<int> noise_table(1 << 16);
    for (int& n : noise_table) n = static_cast<int>(std::lround(noise(random)));
    for (size_t i = 0; i < kImages; ++i) images.push_back(make(i, cells, noise_table, random));
  }

  std::shared_ptr<std::vector<uint8_t>> make(size_t i, const std::vector<uint8_t>& cells,
                                             const std::vector<int>& noise, std::mt19937& random) {
    auto out = std::make_shared<std::vector<uint8_t>>(static_cast<size_t>(width) *
                                                      static_cast<size_t>(height) * 2);
    const int moving_x = 40 + static_cast<int>(i) * 6;
    for (int y = 0; y < height; ++y) {
      uint32_t at = static_cast<uint32_t>(random());
      uint8_t* row = out->data() + static_cast<size_t>(y) * static_cast<size_t>(width) * 2;
      for (int x = 0; x < width; ++x) {
        const bool moving = x > moving_x && x < moving_x + width / 3 && y > 60 && y < height / 2;
        const int sx = moving ? x - moving_x : x;
        const int base = cells[static_cast<size_t>((y / 24) % 64 * 64 + (sx / 24) % 64)] +
                         ((sx * 3 + y * 5) % 24);
        const int value = base + noise[at++ & 0xffff];
        row[2 * x] = static_cast<uint8_t>(std::clamp(value, 16, 235));
        row[2 * x + 1] = static_cast<uint8_t>(108 + (sx / 24 * 7 + y / 24 * 5) % 40);
      }
    }
    return out;
  }
};

// A camera that delivers the footage at the nominal rate, as a driver would.
class FootageSource : public FrameSource {
 public:
  FootageSource(std::shared_ptr<const Footage> footage)
      : footage_(std::move(footage)),
        pool_(std::make_shared<ImagePool>(footage_->width, footage_->height)),
        next_(MonotonicClock::now()) {
    info_.width = footage_->width;
    info_.height = footage_->height;
    info_.nominal_rate_hz = kRate;
  }
  const SourceInfo& info() const override { return info_; }
  Result<SourceStep> next(std::stop_token, Duration) override {
    next_ += from_seconds(1 / kRate);
    std::this_thread::sleep_for(next_ - MonotonicClock::now());
    FrameInfo info;
    info.sequence = sequence_++;
    info.capture = info.arrival = MonotonicClock::now();
    info.format = PixelFormat::kYuyv;
    info.width = footage_->width;
    info.height = footage_->height;
    const auto& bytes = footage_->images[info.sequence % kImages];
    FramePayload payload;
    payload.bytes = *bytes;
    payload.owner = bytes;
    return SourceStep{SourceStep::Kind::kFrame, Frame::raw(info, std::move(payload), pool_)};
  }

 private:
  std::shared_ptr<const Footage> footage_;
  std::shared_ptr<ImagePool> pool_;
  Time next_;
  uint64_t sequence_ = 0;
  SourceInfo info_;
};

EncoderOptions encoder_options(const Footage& footage) {
  EncoderOptions options;
  options.width = footage.width;
  options.height = footage.height;
  options.rate_hz = kRate;
  return options;
}

// CPU per frame of the encoder on ready I420 images.
Result<double> encoder_alone(const std::shared_ptr<const Footage>& footage, double seconds) {
  std::vector<std::shared_ptr<Image>> images;
  for (const auto& bytes : footage->images) {
    images.push_back(std::make_shared<Image>(footage->width, footage->height));
    SL_RETURN_IF_ERROR(raw_to_i420(PixelFormat::kYuyv, *bytes, 0, images.back()->mutable_view()));
  }
  SL_ASSIGN(auto encoder, VideoEncoder::create(encoder_options(*footage), "alone", [](auto) {}));
  const size_t warm = static_cast<size_t>(kRate);
  const size_t frames = warm + static_cast<size_t>(seconds * kRate);
  Time next = MonotonicClock::now();
  double start = 0;
  AnnotatedImage annotated;
  for (size_t i = 0; i < frames; ++i) {
    if (i == warm) start = process_cpu_ms();
    next += from_seconds(1 / kRate);
    std::this_thread::sleep_for(next - MonotonicClock::now());
    annotated.frame.sequence = i;
    annotated.frame.capture = MonotonicClock::now();
    annotated.image = images[i % kImages];
    encoder->push(annotated, {});
  }
  return (process_cpu_ms() - start) / static_cast<double>(frames - warm);
}

// An object of kObjectPx pixels in the middle of the image, published as tracked all the time.
PoseTrackPtr track_now(ObjectId id, Time now) {
  std::vector<PoseEstimate> history;
  for (int i = 10; i >= 0; --i) {
    PoseEstimate estimate;
    estimate.object = id;
    estimate.time = now - i * 33ms;
    estimate.state = TrackState::kTracking;
    estimate.last_measured = estimate.time;
    estimate.world_from_object.translation = {0, 0, 1};
    estimate.twist << 0.3, 0.2, 0.1, 0, 0, 0;
    estimate.covariance.diagonal().setConstant(1e-7);
    history.push_back(estimate);
  }
  return std::make_shared<const PoseTrack>(id, std::move(history), MotionNoise());
}

class Viewer {
 public:
  explicit Viewer(const std::string& url) {
    const std::vector<std::string> words{"ffmpeg", "-loglevel", "error", "-rtsp_transport",
                                         "tcp",    "-i",        url,     "-c",
                                         "copy",   "-f",        "null",  "-"};
    std::vector<char*> argv;
    for (const auto& word : words) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    if (posix_spawnp(&pid_, "ffmpeg", nullptr, nullptr, argv.data(), environ) != 0) pid_ = -1;
  }
  ~Viewer() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  bool running() const { return pid_ > 0; }

 private:
  pid_t pid_ = -1;
};

struct Pipeline {
  Registry registry;
  HeartbeatBoard beats;
  std::shared_ptr<PictureBoard> pictures;
  std::unique_ptr<RtspServer> server;
  std::jthread server_thread;
  std::shared_ptr<TrackBoard> board;
  std::unique_ptr<CameraWorker> worker;

  ~Pipeline() {
    worker.reset();
    server_thread.request_stop();
    if (server_thread.joinable()) server_thread.join();
  }
};

Result<std::unique_ptr<Pipeline>> start_pipeline(const std::shared_ptr<const Footage>& footage,
                                                 bool overlay) {
  auto pipeline = std::make_unique<Pipeline>();
  CameraModel::Parameters lens;
  lens.width = footage->width;
  lens.height = footage->height;
  lens.fx = lens.fy = kFocal;
  lens.cx = footage->width / 2.0;
  lens.cy = footage->height / 2.0;
  lens.distortion = {-0.1, 0.05, 0.0002, -0.0003, 0};
  SL_ASSIGN(const CameraModel model, CameraModel::create(lens, "bench"));
  const CalibratedCamera camera{"bench", model, Rigid3(), 0.3};
  std::vector<OverlayObject> objects;
  std::vector<NamedObject> names;
  if (overlay) {
    const float radius = static_cast<float>(kObjectPx / 2 / kFocal);
    OverlayStyle style;
    style.box3d = true;
    names.push_back({ObjectId(0), "torus"});
    objects.push_back(
        {ObjectId(0), "torus",
         std::make_shared<const RenderMesh>(make_render_mesh(make_bumpy_torus(kTriangles, radius))),
         style});
  }
  RtspOptions rtsp;
  rtsp.port = 0;
  SL_ASSIGN(pipeline->server, RtspServer::create(rtsp));
  pipeline->server_thread = start_thread(
      "rtsp", [raw = pipeline->server.get()](std::stop_token stop) { raw->run(stop); });
  SL_ASSIGN(auto stream,
            pipeline->server->add_stream("bench", {footage->width, footage->height, kRate}));
  CameraParts parts;
  parts.name = "bench";
  parts.width = footage->width;
  parts.height = footage->height;
  parts.open_source = [footage](const std::stop_token&) -> Result<std::unique_ptr<FrameSource>> {
    return std::unique_ptr<FrameSource>(std::make_unique<FootageSource>(footage));
  };
  SL_ASSIGN(parts.draw.renderer, CameraRenderer::create(camera, CameraId(0), std::move(objects),
                                                        RayTable::build(model), nullptr, {}));
  SL_ASSIGN(pipeline->pictures, PictureBoard::start(pipeline->registry, pipeline->beats, nullptr));
  parts.output = StreamOutput::create(
      "bench", encoder_options(*footage), names, std::move(stream), nullptr,
      pipeline->pictures->slot("bench"),
      RecordingSinkWorker::start(RecordingKind::kViewing, pipeline->registry, pipeline->beats),
      pipeline->registry);
  pipeline->board = std::make_shared<TrackBoard>(names.size());
  parts.draw.board = pipeline->board;
  pipeline->worker = CameraWorker::start(std::move(parts), pipeline->registry, pipeline->beats);
  return pipeline;
}

struct PipelineFigures {
  double cpu_ms_per_frame = 0;
  double encoded_per_frame = 0;  // 1 when nothing was dropped
};

Result<PipelineFigures> pipeline_cpu(const std::shared_ptr<const Footage>& footage, double seconds,
                                     bool overlay, bool viewer_on) {
  SL_ASSIGN(auto pipeline, start_pipeline(footage, overlay));
  std::unique_ptr<Viewer> viewer;
  if (viewer_on) {
    viewer = std::make_unique<Viewer>(pipeline->worker->output()->url());
    const Time limit = MonotonicClock::now() + 10s;
    while (pipeline->worker->output()->viewers() == 0) {
      if (!viewer->running() || MonotonicClock::now() > limit) {
        return make_error(ErrorCode::kUnavailable, "ffmpeg", "no viewer came; install ffmpeg");
      }
      std::this_thread::sleep_for(50ms);
    }
  }
  Counter& frames = pipeline->registry.counter("sightline_frames_total", "", {{"camera", "bench"}});
  Counter& encoded =
      pipeline->registry.counter("sightline_images_encoded_total", "", {{"camera", "bench"}});
  const auto publish_for = [&](double duration) {
    const Time end = MonotonicClock::now() + from_seconds(duration);
    while (MonotonicClock::now() < end) {
      if (overlay)
        pipeline->board->publish(ObjectId(0), track_now(ObjectId(0), MonotonicClock::now()));
      std::this_thread::sleep_for(33ms);
    }
  };
  publish_for(1.0);
  const double start = process_cpu_ms();
  const uint64_t first = frames.value(), first_encoded = encoded.value();
  publish_for(seconds);
  const auto count = static_cast<double>(frames.value() - first);
  return PipelineFigures{(process_cpu_ms() - start) / count,
                         static_cast<double>(encoded.value() - first_encoded) / count};
}

Result<nlohmann::ordered_json> measure(int width, int height, double seconds, int rounds) {
  const auto footage = std::make_shared<const Footage>(width, height);
  std::vector<double> alone, plain, drawn;
  double idle = 0, encoded = 1;
  for (int i = 0; i < rounds; ++i) {  // in turn, so that a drifting machine hits all alike
    SL_ASSIGN(const double a, encoder_alone(footage, seconds));
    SL_ASSIGN(const PipelineFigures p, pipeline_cpu(footage, seconds, false, true));
    SL_ASSIGN(const PipelineFigures d, pipeline_cpu(footage, seconds, true, true));
    alone.push_back(a);
    plain.push_back(p.cpu_ms_per_frame / a);
    drawn.push_back(d.cpu_ms_per_frame / a);
    encoded = std::min({encoded, p.encoded_per_frame, d.encoded_per_frame});
  }
  SL_ASSIGN(const PipelineFigures unwatched, pipeline_cpu(footage, seconds, true, false));
  idle = unwatched.cpu_ms_per_frame;
  const auto median = [](std::vector<double>& v) {
    std::nth_element(v.begin(), v.begin() + static_cast<ptrdiff_t>(v.size() / 2), v.end());
    return v[v.size() / 2];
  };
  return nlohmann::ordered_json{{"width", width},
                                {"height", height},
                                {"encoder_alone_ms", median(alone)},
                                {"ratio_without_overlay", median(plain)},
                                {"ratio_with_overlay", median(drawn)},
                                {"encoded_per_captured", encoded},
                                {"no_viewer_ms", idle}};
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  CLI::App app{"CPU of one camera's pipeline against the encoder alone"};
  double seconds = 10;
  int rounds = 3;
  app.add_option("--seconds", seconds, "of each measurement")->check(CLI::Range(1.0, 600.0));
  app.add_option("--rounds", rounds, "median of so many")->check(CLI::Range(1, 100));
  CLI11_PARSE(app, argc, argv);
  auto results = nlohmann::ordered_json::array();
  for (const auto& [width, height] : {std::pair{1280, 720}, std::pair{1920, 1080}}) {
    auto result = sightline::measure(width, height, seconds, rounds);
    if (!result) {
      std::fprintf(stderr, "bench_daemon: %s\n", result.error().message().c_str());
      return sightline::exit_code(result.error());
    }
    results.push_back(*result);
  }
  fmt::print("{}\n", results.dump(2));
  return 0;
}
