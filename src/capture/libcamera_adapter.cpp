// SPDX-License-Identifier: Apache-2.0
// All of libcamera that Sightline uses, for releases from 0.0.3 on; their interface changes with
// each.
#include <libcamera/camera.h>
#include <libcamera/camera_manager.h>
#include <libcamera/control_ids.h>
#include <libcamera/framebuffer_allocator.h>
#include <libcamera/logging.h>
#include <libcamera/property_ids.h>
#include <libcamera/request.h>
#include <libcamera/version.h>
#include <linux/dma-buf.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <ctime>
#include <list>
#include <mutex>
#include <ostream>
#include <streambuf>
#include <thread>
#include <utility>

#include "libcamera_camera.hpp"
#include "libcamera_controls.hpp"
#include "sightline/base/log.hpp"
#include "sightline/base/unique_fd.hpp"
#include "sightline/image/convert.hpp"

namespace sightline {
namespace {

using libcamera::Camera;
using libcamera::FrameBuffer;
using libcamera::Request;
using libcamera::StreamConfiguration;
using libcamera::StreamRole;

constexpr Duration kLastWords = std::chrono::milliseconds(100);

std::string reason(int negative_errno) { return std::strerror(-negative_errno); }

// libcamera's own log lines go where ours go; most of its warnings mean nothing to a user.
class LogLines final : public std::streambuf {
 protected:
  std::streamsize xsputn(const char* text, std::streamsize size) override {
    std::string_view line(text, static_cast<size_t>(size));
    while (!line.empty() && line.back() == '\n') line.remove_suffix(1);
    const bool grave = line.find("ERROR") != line.npos || line.find("FATAL") != line.npos;
    if (line.empty()) return size;
    grave ? log::warning("libcamera: {}", line) : log::debug("libcamera: {}", line);
    return size;
  }
  int_type overflow(int_type c) override { return traits_type::not_eof(c); }
};

// What the requests of one opening come to. libcamera's thread adds, the source's takes.
class Completions {
 public:
  Completions(size_t buffers, libcamera::ControlList controls, std::string where)
      : controls_(std::move(controls)), where_(std::move(where)) {
    shots_.reserve(buffers);
  }

  void complete(Request& request) {
    if (request.status() != Request::RequestComplete || request.buffers().empty()) return;
    LibcameraShot shot;
    shot.slot = static_cast<size_t>(request.cookie());
    const libcamera::FrameMetadata& frame = request.buffers().begin()->second->metadata();
    shot.good = frame.status == libcamera::FrameMetadata::FrameSuccess;
    shot.sequence = frame.sequence;
    for (const auto& plane : frame.planes()) shot.bytes += plane.bytesused;
    const libcamera::ControlList& told = request.metadata();
    shot.sensor_ns = told.get(libcamera::controls::SensorTimestamp).value_or(0);
    shot.exposure_ns = int64_t{1000} * told.get(libcamera::controls::ExposureTime).value_or(0);
    if (shot.good && ++good_ == kSettled) {
      for (const auto& line : control_differences(controls_, told)) {
        log::warning("{}: {}", where_, line);
      }
    }
    std::lock_guard lock(mutex_);
    shots_.push_back(shot);
    changed_.notify_one();
  }

  void disconnected() {
    std::lock_guard lock(mutex_);
    gone_ = true;
    changed_.notify_one();
  }

  bool gone() const {
    std::lock_guard lock(mutex_);
    return gone_;
  }

  /// The oldest shot; nullopt: none in time, or the camera is gone.
  std::optional<LibcameraShot> wait(Duration limit, bool& gone) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, limit, [this] { return gone_ || !shots_.empty(); });
    gone = gone_;
    if (gone_ || shots_.empty()) return std::nullopt;
    const LibcameraShot shot = shots_.front();
    shots_.erase(shots_.begin());
    return shot;
  }

 private:
  static constexpr int kSettled = 10;  // frames after which controls have come into force

  const libcamera::ControlList controls_;
  const std::string where_;
  int good_ = 0;  // libcamera's thread only
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<LibcameraShot> shots_;
  bool gone_ = false;
};

// The receiver of a camera's signals. Connected once, for the camera's life: libcamera does not
// allow to disconnect while its thread emits.
class Ear {
 public:
  explicit Ear(const std::shared_ptr<Camera>& camera) : camera_(camera) {
    camera->requestCompleted.connect(this, &Ear::on_completed);
    camera->disconnected.connect(this, &Ear::on_disconnected);
  }
  Ear(const Ear&) = delete;
  Ear& operator=(const Ear&) = delete;

  bool is_of(const std::shared_ptr<Camera>& camera) const { return camera_.lock() == camera; }
  bool is_orphan() const { return camera_.expired(); }
  void listen(std::shared_ptr<Completions> completions) {
    std::lock_guard lock(mutex_);
    completions_ = std::move(completions);
  }

 private:
  void on_completed(Request* request) {
    std::lock_guard lock(mutex_);
    if (completions_) completions_->complete(*request);
  }
  void on_disconnected() {
    std::lock_guard lock(mutex_);
    if (completions_) completions_->disconnected();
  }

  const std::weak_ptr<Camera> camera_;
  std::mutex mutex_;
  std::shared_ptr<Completions> completions_;
};

// The one camera manager that libcamera allows a process.
class Manager {
 public:
  static Result<Manager*> get() {
    static Manager manager;
    std::lock_guard lock(manager.mutex_);
    if (!manager.started_) manager.start();
    if (manager.started_) return &manager;
    return make_error(ErrorCode::kUnavailable, "", "libcamera does not start: {}",
                      reason(manager.failure_));
  }

  std::vector<std::shared_ptr<Camera>> cameras() {
    auto all = cameras_->cameras();
    std::sort(all.begin(), all.end(),
              [](const auto& a, const auto& b) { return a->id() < b->id(); });
    return all;
  }

  std::shared_ptr<Camera> find(const std::string& id) {
    for (auto& camera : cameras_->cameras()) {
      if (camera->id() == id) return camera;
    }
    return nullptr;
  }

  Ear& ear_of(const std::shared_ptr<Camera>& camera) {
    std::lock_guard lock(mutex_);
    ears_.remove_if([](const Ear& ear) { return ear.is_orphan(); });
    for (Ear& ear : ears_) {
      if (ear.is_of(camera)) return ear;
    }
    return ears_.emplace_back(camera);
  }

 private:
  // All that libcamera makes on first use is made in here, so that it is destroyed after this.
  Manager() : log_(&lines_) {
    libcamera::logSetStream(&log_);
    cameras_ = std::make_unique<libcamera::CameraManager>();
    start();
  }
  ~Manager() {
    if (started_) cameras_->stop();
    cameras_.reset();
    libcamera::logSetTarget(libcamera::LoggingTargetNone);
  }

  void start() {
    failure_ = cameras_->start();
    started_ = failure_ >= 0;
  }

  std::mutex mutex_;
  bool started_ = false;
  int failure_ = 0;
  LogLines lines_;
  std::ostream log_;
  std::unique_ptr<libcamera::CameraManager> cameras_;
  std::list<Ear> ears_;
};

// A buffer's memory as this process sees it.
class Mapping {
 public:
  static Result<Mapping> of(const FrameBuffer& buffer, const std::string& where) {
    const auto& planes = buffer.planes();
    size_t length = 0;
    for (size_t i = 0; i < planes.size(); ++i) {
      if (planes[i].fd.get() != planes[0].fd.get() ||
          planes[i].offset != planes[0].offset + length) {
        return make_error(ErrorCode::kInvalidInput, where,
                          "the camera's buffers have their planes apart; choose another format");
      }
      length += planes[i].length;
    }
    if (length == 0) return make_error(ErrorCode::kIo, where, "the camera's buffers are empty");
    Mapping mapping;
    mapping.skipped_ = planes[0].offset;
    mapping.length_ = length;
    mapping.fd_.reset(::dup(planes[0].fd.get()));
    void* const memory =
        ::mmap(nullptr, mapping.skipped_ + length, PROT_READ, MAP_SHARED, mapping.fd_.get(), 0);
    if (memory == MAP_FAILED) {
      return make_error(ErrorCode::kIo, where, "cannot map the camera's buffers: {}",
                        reason(-errno));
    }
    mapping.memory_ = static_cast<uint8_t*>(memory);
    return mapping;
  }

  Mapping(Mapping&& other) noexcept
      : memory_(std::exchange(other.memory_, nullptr)),
        skipped_(other.skipped_),
        length_(other.length_),
        fd_(std::move(other.fd_)) {}
  Mapping& operator=(Mapping&&) = delete;
  ~Mapping() {
    if (memory_ != nullptr) ::munmap(memory_, skipped_ + length_);
  }

  std::span<const uint8_t> bytes() const { return {memory_ + skipped_, length_}; }
  int fd() const { return fd_.get(); }
  /// Between these two the processor may read; elsewhere the device may write.
  void begin_reading() const { synchronise(DMA_BUF_SYNC_START); }
  void end_reading() const { synchronise(DMA_BUF_SYNC_END); }

 private:
  Mapping() = default;
  void synchronise(uint64_t which) const {
    dma_buf_sync sync{which | DMA_BUF_SYNC_READ};
    ::ioctl(fd_.get(), DMA_BUF_IOCTL_SYNC, &sync);  // memory that is no DMA-BUF needs none
  }

  uint8_t* memory_ = nullptr;
  size_t skipped_ = 0, length_ = 0;
  UniqueFd fd_;
};

class RealCamera final : public LibcameraCamera {
 public:
  RealCamera(std::shared_ptr<Camera> camera, Ear& ear, std::string where)
      : camera_(std::move(camera)), ear_(ear), id_(camera_->id()), where_(std::move(where)) {}
  RealCamera(const RealCamera&) = delete;
  RealCamera& operator=(const RealCamera&) = delete;
  ~RealCamera() override { RealCamera::close(); }

  Status set_up(const LibcameraOptions& options);

  const std::string& id() const override { return id_; }
  const LibcameraStream& stream() const override { return stream_; }
  std::span<const uint8_t> memory(size_t slot) const override { return mappings_[slot].bytes(); }
  int dmabuf_fd(size_t slot) const override { return mappings_[slot].fd(); }

  Status start() override;
  Status queue(size_t slot) override;
  Result<std::optional<LibcameraShot>> wait(Duration limit) override;
  void close() override;

  Time now() const override { return MonotonicClock::now(); }
  Duration time_asleep() const override {
    timespec boot{};
    ::clock_gettime(CLOCK_BOOTTIME, &boot);
    const Duration since_boot(int64_t{boot.tv_sec} * 1'000'000'000 + boot.tv_nsec);
    return since_boot - MonotonicClock::now().time_since_epoch();
  }

 private:
  Result<StreamConfiguration*> choose(const LibcameraOptions& options);
  Status agree(const LibcameraOptions& options, StreamConfiguration& stream);
  Status allocate(const StreamConfiguration& stream);
  void set_rate(double rate_hz);
  bool has_devices() const;
  Error failed(const char* what, int negative_errno) const;

  std::shared_ptr<Camera> camera_;  // null once closed
  Ear& ear_;
  const std::string id_, where_;
  std::unique_ptr<libcamera::CameraConfiguration> configuration_;
  std::unique_ptr<libcamera::FrameBufferAllocator> allocator_;
  std::vector<std::unique_ptr<Request>> requests_;
  std::vector<Mapping> mappings_;
  LibcameraStream stream_;
  libcamera::ControlList controls_;
  std::shared_ptr<Completions> completions_;
  bool running_ = false;
};

Error RealCamera::failed(const char* what, int negative_errno) const {
  const bool busy = negative_errno == -EBUSY;
  const bool gone = negative_errno == -ENODEV || negative_errno == -EACCES;
  return make_error(busy || gone ? ErrorCode::kUnavailable : ErrorCode::kIo, where_,
                    "cannot {} {}: {}{}", what, id_, reason(negative_errno),
                    busy ? "; another program is using the camera" : "");
}

std::vector<const V4l2Format*> formats_of(const StreamConfiguration& stream) {
  std::vector<const V4l2Format*> formats;
  for (const auto& pixels : stream.formats().pixelformats()) {
    const V4l2Format* const format = find_libcamera_format(pixels.toString());
    if (format != nullptr && format->kind != V4l2Kind::kH264) formats.push_back(format);
  }
  return formats;
}

libcamera::PixelFormat pixels_of(const StreamConfiguration& stream, const V4l2Format* format) {
  for (const auto& pixels : stream.formats().pixelformats()) {
    if (find_libcamera_format(pixels.toString()) == format) return pixels;
  }
  return {};
}

bool has_size(const StreamConfiguration& stream, const V4l2Format* format,
              const libcamera::Size& size) {
  const auto pixels = pixels_of(stream, format);
  const auto sizes = stream.formats().sizes(pixels);
  return sizes.empty() || std::find(sizes.begin(), sizes.end(), size) != sizes.end() ||
         stream.formats().range(pixels).contains(size);
}

std::string list_of(const StreamConfiguration& stream) {
  std::string text;
  for (const auto& pixels : stream.formats().pixelformats()) {
    const V4l2Format* const format = find_libcamera_format(pixels.toString());
    const std::string name = format != nullptr ? std::string(format->name) : pixels.toString();
    for (const auto& size : stream.formats().sizes(pixels)) {
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", name, size.toString());
    }
  }
  return text.empty() ? "nothing" : text;
}

// Sets format and size in the camera's own proposal; the first format of our liking for "auto".
Result<StreamConfiguration*> RealCamera::choose(const LibcameraOptions& options) {
  const bool automatic = options.format.empty() || options.format == "auto";
  const V4l2Format* const named =
      automatic ? nullptr : find_libcamera_format(std::string_view(options.format));
  const bool raw = named != nullptr && named->kind == V4l2Kind::kBayer;
  configuration_ =
      camera_->generateConfiguration({raw ? StreamRole::Raw : StreamRole::VideoRecording});
  if (!configuration_ || configuration_->empty()) {
    return make_error(ErrorCode::kInvalidInput, where_, "{} offers no {} pictures", id_,
                      raw ? "raw" : "video");
  }
  StreamConfiguration& stream = configuration_->at(0);
  if (options.width > 0 && options.height > 0) {
    stream.size = {static_cast<unsigned>(options.width), static_cast<unsigned>(options.height)};
  }
  const auto offered = formats_of(stream);
  const V4l2Format* chosen = nullptr;
  for (const V4l2Format& format : v4l2_formats()) {
    if (chosen != nullptr || (!automatic && &format != named)) continue;
    if (std::find(offered.begin(), offered.end(), &format) == offered.end()) continue;
    if (has_size(stream, &format, stream.size)) chosen = &format;
  }
  if (chosen == nullptr) {
    return make_error(ErrorCode::kInvalidInput, where_, "{} has no {} {}; it has: {}", id_,
                      automatic ? "usable format for" : options.format, stream.size.toString(),
                      list_of(stream));
  }
  stream.pixelFormat = pixels_of(stream, chosen);
  stream_.format = chosen;
  return &stream;
}

// What the camera makes of the choice must be the choice.
Status RealCamera::agree(const LibcameraOptions& options, StreamConfiguration& stream) {
  const auto wanted_size = stream.size;
  const auto wanted_pixels = stream.pixelFormat;
  stream.bufferCount = static_cast<unsigned>(std::clamp(options.buffers, 4, 16));
  const auto verdict = configuration_->validate();
  if (verdict == libcamera::CameraConfiguration::Invalid || stream.size != wanted_size ||
      stream.pixelFormat != wanted_pixels) {
    return make_error(ErrorCode::kInvalidInput, where_, "{} gives {} when asked for {} {}", id_,
                      stream.toString(), stream_.format->name, wanted_size.toString());
  }
  if (const int r = camera_->configure(configuration_.get()); r < 0) {
    return failed("configure", r);
  }
  stream_.width = static_cast<int>(stream.size.width);
  stream_.height = static_cast<int>(stream.size.height);
  const V4l2Format& format = *stream_.format;
  if (format.kind == V4l2Kind::kRaw) {
    stream_.stride = stream.stride;
    SL_ASSIGN(stream_.image_bytes,
              raw_picture_bytes(format.pixels, stream_.width, stream_.height, stream_.stride));
  } else if (format.kind == V4l2Kind::kBayer) {
    const size_t row = bayer_row_bytes(format.packing, stream_.width);
    stream_.stride = static_cast<ptrdiff_t>(std::max<size_t>(row, stream.stride));
    stream_.image_bytes = static_cast<size_t>(stream_.stride) * (stream.size.height - 1) + row;
  }
  return {};
}

Status RealCamera::allocate(const StreamConfiguration& stream) {
  allocator_ = std::make_unique<libcamera::FrameBufferAllocator>(camera_);
  if (const int r = allocator_->allocate(stream.stream()); r < 0) {
    return failed("get buffers from", r);
  }
  const auto& buffers = allocator_->buffers(stream.stream());
  for (size_t slot = 0; slot < buffers.size(); ++slot) {
    SL_ASSIGN(Mapping mapping, Mapping::of(*buffers[slot], where_));
    if (mapping.bytes().size() < std::max<size_t>(stream_.image_bytes, 1)) {
      return make_error(ErrorCode::kIo, where_, "a picture of {} bytes in a buffer of {}",
                        stream_.image_bytes, mapping.bytes().size());
    }
    mappings_.push_back(std::move(mapping));
    auto request = camera_->createRequest(slot);
    if (!request || request->addBuffer(stream.stream(), buffers[slot].get()) < 0) {
      return make_error(ErrorCode::kIo, where_, "{} takes no requests", id_);
    }
    requests_.push_back(std::move(request));
  }
  if (requests_.size() < 2) return failed("get buffers from", -ENOMEM);
  stream_.buffers = requests_.size();
  return {};
}

void RealCamera::set_rate(double rate_hz) {
  const auto limits = camera_->controls().find(libcamera::controls::FrameDurationLimits.id());
  if (rate_hz <= 0) return;
  if (limits == camera_->controls().end()) {
    log::warning("{}: the camera's rate cannot be set through libcamera; it keeps its own", where_);
    return;
  }
  const auto microseconds = static_cast<int64_t>(std::lround(1e6 / rate_hz));
  const std::array<int64_t, 2> both{microseconds, microseconds};
  controls_.set(libcamera::controls::FrameDurationLimits, libcamera::Span<const int64_t, 2>(both));
  stream_.rate_hz = rate_hz;
}

Status RealCamera::set_up(const LibcameraOptions& options) {
  if (const int r = camera_->acquire(); r < 0) {
    camera_.reset();  // not ours to give back
    return make_error(ErrorCode::kUnavailable, where_,
                      "cannot take {}: {}; another program is using it, or it is going", id_,
                      reason(r));
  }
  SL_ASSIGN(StreamConfiguration * stream, choose(options));
  SL_RETURN_IF_ERROR(agree(options, *stream));
  SL_ASSIGN(controls_, libcamera_controls(camera_->controls(), options.controls, where_));
  set_rate(options.rate_hz);
  return allocate(*stream);
}

Status RealCamera::start() {
  completions_ = std::make_shared<Completions>(requests_.size(), controls_, where_);
  ear_.listen(completions_);
  if (const int r = camera_->start(&controls_); r < 0) return failed("start", r);
  running_ = true;
  // Some handlers, that of webcams among them, look at the controls of requests only.
  requests_.front()->controls().merge(controls_);
  for (const auto& request : requests_) {
    if (const int r = camera_->queueRequest(request.get()); r < 0) return failed("start", r);
  }
  return {};
}

Status RealCamera::queue(size_t slot) {
  mappings_[slot].end_reading();
  Request& request = *requests_[slot];
  request.reuse(Request::ReuseBuffers);
  const int r = camera_->queueRequest(&request);
  return r < 0 ? Status(failed("go on with", r)) : Status();
}

Result<std::optional<LibcameraShot>> RealCamera::wait(Duration limit) {
  bool gone = false;
  auto shot = completions_->wait(limit, gone);
  if (gone) {
    return make_error(ErrorCode::kUnavailable, where_,
                      "the camera is gone: {} was unplugged or has switched itself off", id_);
  }
  if (shot) {
    shot->bytes = std::min(shot->bytes, mappings_[shot->slot].bytes().size());
    mappings_[shot->slot].begin_reading();
  }
  return shot;
}

// Whether the kernel still knows the camera; libcamera hears of its going later.
bool RealCamera::has_devices() const {
#if LIBCAMERA_VERSION_MAJOR > 0 || LIBCAMERA_VERSION_MINOR >= 1
  const auto devices = camera_->properties().get(libcamera::properties::SystemDevices);
  for (const int64_t device : devices.value_or(libcamera::Span<const int64_t>())) {
    const auto number = static_cast<dev_t>(device);
    const auto path = fmt::format("/sys/dev/char/{}:{}", major(number), minor(number));
    if (::access(path.c_str(), F_OK) != 0) return false;
  }
#endif
  return true;
}

void RealCamera::close() {
  if (!camera_) return;
  // libcamera 0.4 cannot stop an unplugged camera: the driver takes no request back, and an
  // assertion ends the process. Destroyed as it runs, it closes the device and only complains. What
  // was asked of its thread just before is let pass first.
  const bool gone = (completions_ && completions_->gone()) || !has_devices();
  if (gone) std::this_thread::sleep_for(kLastWords);
  if (running_ && !gone) camera_->stop();
  ear_.listen(nullptr);
  requests_.clear();
  allocator_.reset();
  configuration_.reset();
  if (!gone) camera_->release();
  camera_.reset();
}

std::vector<double> rates_of(const Camera& camera) {
  const auto found = camera.controls().find(libcamera::controls::FrameDurationLimits.id());
  if (found == camera.controls().end()) return {};
  const auto& low = found->second.min();
  const auto& high = found->second.max();
  for (const auto* const value : {&low, &high}) {
    if (value->type() != libcamera::ControlTypeInteger64 || value->isArray()) return {};
    if (value->get<int64_t>() <= 0) return {};
  }
  return {1e6 / static_cast<double>(high.get<int64_t>()),
          1e6 / static_cast<double>(low.get<int64_t>())};
}

DeviceInfo describe(Camera& camera) {
  DeviceInfo info;
  info.scheme = "libcamera";
  info.id = camera.id();
  info.model = camera.properties().get(libcamera::properties::Model).value_or("camera");
  info.where = "libcamera";
  const auto rates = rates_of(camera);
  for (const StreamRole role : {StreamRole::VideoRecording, StreamRole::Raw}) {
    const auto configuration = camera.generateConfiguration({role});
    if (!configuration || configuration->empty()) continue;
    const auto& offered = configuration->at(0).formats();
    for (const auto& pixels : offered.pixelformats()) {
      const V4l2Format* const format = find_libcamera_format(pixels.toString());
      if (format == nullptr || format->kind == V4l2Kind::kH264) continue;
      for (const auto& size : offered.sizes(pixels)) {
        const FormatInfo mode{std::string(format->name), static_cast<int>(size.width),
                              static_cast<int>(size.height), rates};
        const bool known = std::any_of(info.formats.begin(), info.formats.end(), [&](auto& f) {
          return f.pixel_format == mode.pixel_format && f.width == mode.width &&
                 f.height == mode.height;
        });
        if (!known) info.formats.push_back(mode);
      }
    }
  }
  if (info.formats.empty()) info.note = "no format that Sightline knows";
  return info;
}

}  // namespace

Result<std::unique_ptr<FrameSource>> open_libcamera_source(const LibcameraOptions& options,
                                                           CameraId camera,
                                                           const std::string& name) {
  const auto manager = Manager::get();
  if (!manager) return make_error(manager.error().code, name, "{}", manager.error().text);
  auto found = (*manager)->find(options.id);
  if (!found) {
    std::string others;
    for (const auto& other : (*manager)->cameras()) {
      others += (others.empty() ? "" : ", ") + other->id();
    }
    return make_error(ErrorCode::kUnavailable, name, "libcamera has no camera '{}'; it has: {}",
                      options.id, others.empty() ? "none" : others);
  }
  Ear& ear = (*manager)->ear_of(found);
  auto device = std::make_shared<RealCamera>(std::move(found), ear, name);
  SL_RETURN_IF_ERROR(device->set_up(options));
  const LibcameraStream& stream = device->stream();
  log::info("{}: {} gives {} {}x{}{}", name, options.id, stream.format->name, stream.width,
            stream.height, stream.rate_hz > 0 ? fmt::format(" at {:g}/s", stream.rate_hz) : "");
  return open_libcamera_source_on(std::move(device), options, camera, name);
}

Result<std::vector<DeviceInfo>> list_libcamera() {
  SL_ASSIGN(Manager * manager, Manager::get());
  std::vector<DeviceInfo> list;
  for (const auto& camera : manager->cameras()) list.push_back(describe(*camera));
  return list;
}

std::string libcamera_version() {
  return fmt::format("libcamera {}", libcamera::CameraManager::version());
}

}  // namespace sightline
