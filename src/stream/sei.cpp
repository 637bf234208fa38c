// SPDX-License-Identifier: Apache-2.0
#include "sightline/stream/sei.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <concepts>
#include <limits>

#include "sightline/image/h264.hpp"

namespace sightline {

const std::array<uint8_t, 16> kSeiUuid = {0x5b, 0x1c, 0x3a, 0x9e, 0x7d, 0x42, 0x4f, 0x6a,
                                          0x9b, 0x08, 0xe1, 0x53, 0xc4, 0x2f, 0x8d, 0x71};

namespace {

constexpr uint8_t kVersion = 1;
constexpr uint8_t kUserDataUnregistered = 5;
constexpr size_t kMaxName = 255;
constexpr size_t kMaxObjects = 255;

// --- writing -------------------------------------------------------------------------------------

/// Little-endian bytes.
class Writer {
 public:
  explicit Writer(std::vector<uint8_t>& to) : to_(to) {}

  template <std::unsigned_integral T>
  void put(T value) {
    for (size_t i = 0; i < sizeof(T); ++i) to_.push_back(static_cast<uint8_t>(value >> (8 * i)));
  }
  void put(int64_t value) { put(static_cast<uint64_t>(value)); }
  void put(double value) { put(std::bit_cast<uint64_t>(value)); }
  void put(float value) { put(std::bit_cast<uint32_t>(value)); }
  void put(std::string_view text) { to_.insert(to_.end(), text.begin(), text.end()); }
  /// Leaves room for a length that finish_record() fills in.
  size_t begin_record() {
    put(uint16_t{0});
    return to_.size() - 2;
  }
  void finish_record(size_t begin) {
    const size_t length = to_.size() - begin;
    to_[begin] = static_cast<uint8_t>(length);
    to_[begin + 1] = static_cast<uint8_t>(length >> 8);
  }

 private:
  std::vector<uint8_t>& to_;
};

/// At most kMaxName bytes, not ending inside a UTF-8 character.
std::string_view cut_name(std::string_view name) {
  if (name.size() <= kMaxName) return name;
  size_t length = kMaxName;
  while (length > 0 && (static_cast<uint8_t>(name[length]) & 0xc0) == 0x80) --length;
  return name.substr(0, length);
}

void put_header(Writer& writer, const SeiMessage& message, size_t objects) {
  const std::string_view camera = cut_name(message.camera);
  const int64_t error =
      std::clamp<int64_t>(message.capture_error.count(), 0, std::numeric_limits<uint32_t>::max());
  writer.put(kVersion);
  const size_t record = writer.begin_record();
  writer.put(static_cast<uint8_t>(objects));
  writer.put(message.epoch);
  writer.put(message.sequence);
  writer.put(to_ns(message.capture));
  writer.put(message.capture_utc_ns);
  writer.put(static_cast<uint32_t>(error));
  writer.put(static_cast<uint8_t>(camera.size()));
  writer.put(camera);
  writer.finish_record(record);
}

void put_object(Writer& writer, const SeiObject& object) {
  const std::string_view name = cut_name(object.name);
  const size_t record = writer.begin_record();
  writer.put(object.id.index());
  writer.put(static_cast<uint8_t>(object.state));
  writer.put(static_cast<uint8_t>(object.source));
  writer.put(static_cast<uint8_t>(name.size()));
  writer.put(name);
  if (object.source != PoseSource::kNone) {
    const Eigen::Vector3d& t = object.world_from_object.translation;
    const Eigen::Quaterniond& q = object.world_from_object.rotation;
    for (const double v : {t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()}) writer.put(v);
    writer.put(object.sigma_translation);
    writer.put(object.sigma_rotation);
  }
  writer.finish_record(record);
}

/// payloadType or payloadSize of an SEI message: runs of 255, then the rest (7.3.2.3.1).
void put_sei_number(std::vector<uint8_t>& to, size_t number) {
  for (; number >= 255; number -= 255) to.push_back(255);
  to.push_back(static_cast<uint8_t>(number));
}

// --- reading -------------------------------------------------------------------------------------

/// Little-endian reader that remembers running out of bytes and yields zeros from there on.
class Reader {
 public:
  explicit Reader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  template <std::unsigned_integral T>
  T get() {
    T value = 0;
    const auto part = take(sizeof(T));
    for (size_t i = 0; i < part.size(); ++i) {
      value = static_cast<T>(value | static_cast<T>(T{part[i]} << (8 * i)));
    }
    return value;
  }
  int64_t get_signed() { return static_cast<int64_t>(get<uint64_t>()); }
  double get_double() { return std::bit_cast<double>(get<uint64_t>()); }
  float get_float() { return std::bit_cast<float>(get<uint32_t>()); }
  std::string get_text(size_t length) {
    const auto part = take(length);
    return std::string(part.begin(), part.end());
  }
  /// A record that starts with its own length; unknown trailing fields stay unread.
  Reader get_record() {
    const size_t length = get<uint16_t>();
    if (length < 2) ok_ = false;
    Reader record(take(length < 2 ? 0 : length - 2));
    return record;
  }
  bool ok() const { return ok_; }

 private:
  std::span<const uint8_t> take(size_t length) {
    if (length > bytes_.size()) {
      ok_ = false;
      bytes_ = {};
      return {};
    }
    const auto part = bytes_.first(length);
    bytes_ = bytes_.subspan(length);
    return part;
  }

  std::span<const uint8_t> bytes_;
  bool ok_ = true;
};

Error damaged(const char* what) {
  return make_error(ErrorCode::kDamaged, "SEI message", "{}; the stream was cut or altered", what);
}

bool is_unit(const Eigen::Quaterniond& q) { return std::abs(q.norm() - 1.0) < 1e-6; }

Result<SeiObject> read_object(Reader& reader) {
  Reader record = reader.get_record();
  if (!reader.ok()) return damaged("an object is cut short");
  SeiObject object;
  object.id = ObjectId(record.get<uint32_t>());
  const uint8_t state = record.get<uint8_t>();
  const uint8_t source = record.get<uint8_t>();
  if (state > static_cast<uint8_t>(TrackState::kLost)) return damaged("an unknown track state");
  if (source > static_cast<uint8_t>(PoseSource::kPredicted)) return damaged("unknown pose source");
  object.state = static_cast<TrackState>(state);
  object.source = static_cast<PoseSource>(source);
  object.name = record.get_text(record.get<uint8_t>());
  if (object.source != PoseSource::kNone) {
    std::array<double, 7> v{};
    for (double& value : v) value = record.get_double();
    object.sigma_translation = record.get_float();
    object.sigma_rotation = record.get_float();
    // Assigned, not constructed: normalizing again would change the last bit.
    object.world_from_object.translation = {v[0], v[1], v[2]};
    object.world_from_object.rotation = Eigen::Quaterniond(v[3], v[4], v[5], v[6]);
    if (!record.ok()) return damaged("a pose is cut short");
    if (!object.world_from_object.translation.allFinite() ||
        !is_unit(object.world_from_object.rotation) || !std::isfinite(object.sigma_translation) ||
        !std::isfinite(object.sigma_rotation)) {
      return damaged("a pose is not a rigid transform");
    }
  }
  if (!record.ok()) return damaged("an object is cut short");
  return object;
}

Result<SeiMessage> read_message(std::span<const uint8_t> payload) {
  Reader reader(payload);
  if (reader.get<uint8_t>() != kVersion) return damaged("not version 1");
  Reader header = reader.get_record();
  if (!reader.ok()) return damaged("the header is cut short");
  SeiMessage message;
  const size_t objects = header.get<uint8_t>();
  message.epoch = header.get<uint32_t>();
  message.sequence = header.get<uint64_t>();
  message.capture = time_from_ns(header.get_signed());
  message.capture_utc_ns = header.get_signed();
  message.capture_error = Duration(header.get<uint32_t>());
  message.camera = header.get_text(header.get<uint8_t>());
  if (!header.ok()) return damaged("the header is cut short");
  for (size_t i = 0; i < objects; ++i) {
    SL_ASSIGN(auto object, read_object(reader));
    message.objects.push_back(std::move(object));
  }
  return message;
}

/// A number as put_sei_number() writes it; false if the bytes end first.
bool take_sei_number(std::span<const uint8_t>& from, size_t& number) {
  number = 0;
  while (!from.empty()) {
    const uint8_t byte = from.front();
    from = from.subspan(1);
    number += byte;
    if (byte != 255) return true;
  }
  return false;
}

/// The part of our message behind the UUID in an SEI unit without its header byte; empty span data
/// pointer if it holds none.
std::span<const uint8_t> find_ours(std::span<const uint8_t> sei) {
  // One byte is the trailing stop bit, never a message.
  while (sei.size() > 1) {
    size_t type = 0, size = 0;
    if (!take_sei_number(sei, type) || !take_sei_number(sei, size)) return {};
    const auto payload = sei.first(std::min(size, sei.size()));
    if (type == kUserDataUnregistered && payload.size() >= kSeiUuid.size() &&
        std::equal(kSeiUuid.begin(), kSeiUuid.end(), payload.begin())) {
      return payload.subspan(kSeiUuid.size());
    }
    sei = sei.subspan(payload.size());
  }
  return {};
}

std::string name_of(ObjectId id, std::span<const NamedObject> names) {
  const auto found =
      std::find_if(names.begin(), names.end(), [&](const NamedObject& n) { return n.id == id; });
  return found == names.end() ? std::string() : found->name;
}

}  // namespace

SeiMessage sei_message_of(const AnnotatedImage& image, const std::string& camera_name,
                          std::span<const NamedObject> names) {
  SeiMessage message;
  message.camera = camera_name;
  message.epoch = image.frame.epoch;
  message.sequence = image.frame.sequence;
  message.capture = image.frame.capture;
  message.capture_utc_ns = utc_ns_of(image.frame.capture);
  message.capture_error = image.frame.capture_error;
  for (const PoseAt& pose : image.poses) {
    SeiObject object;
    object.id = pose.estimate.object;
    object.name = name_of(object.id, names);
    object.state = pose.estimate.state;
    object.source = pose.source;
    if (pose.source != PoseSource::kNone) {
      object.world_from_object = pose.estimate.world_from_object;
      object.sigma_translation = static_cast<float>(pose.estimate.sigma_translation());
      object.sigma_rotation = static_cast<float>(pose.estimate.sigma_rotation());
    }
    message.objects.push_back(std::move(object));
  }
  return message;
}

std::vector<uint8_t> make_sei_nal(const SeiMessage& message) {
  std::vector<uint8_t> payload(kSeiUuid.begin(), kSeiUuid.end());
  Writer writer(payload);
  const size_t objects = std::min(message.objects.size(), kMaxObjects);
  put_header(writer, message, objects);
  for (size_t i = 0; i < objects; ++i) put_object(writer, message.objects[i]);

  std::vector<uint8_t> raw;
  raw.reserve(payload.size() + 8);
  raw.push_back(static_cast<uint8_t>(NalType::kSei));
  put_sei_number(raw, kUserDataUnregistered);
  put_sei_number(raw, payload.size());
  raw.insert(raw.end(), payload.begin(), payload.end());
  raw.push_back(0x80);  // stop bit

  std::vector<uint8_t> nal = {0, 0, 0, 1};
  nal.reserve(raw.size() + raw.size() / 16 + 8);
  append_escaped(raw, nal);
  return nal;
}

std::vector<uint8_t> insert_sei(std::span<const uint8_t> access_unit,
                                std::span<const uint8_t> sei_nal) {
  size_t at = access_unit.size();
  NalReader reader(access_unit);
  while (const auto nal = reader.next()) {
    if (!nal->is_slice()) continue;
    at = nal->begin;
    break;
  }
  std::vector<uint8_t> joined;
  joined.reserve(access_unit.size() + sei_nal.size());
  const auto split = access_unit.begin() + static_cast<ptrdiff_t>(at);
  joined.insert(joined.end(), access_unit.begin(), split);
  joined.insert(joined.end(), sei_nal.begin(), sei_nal.end());
  joined.insert(joined.end(), split, access_unit.end());
  return joined;
}

Result<SeiMessage> parse_sei(std::span<const uint8_t> access_unit) {
  NalReader reader(access_unit);
  while (const auto nal = reader.next()) {
    if (nal->type != NalType::kSei) continue;
    const std::vector<uint8_t> raw = unescaped(nal->body.subspan(1));
    const auto ours = find_ours(raw);
    if (ours.data() != nullptr) return read_message(ours);
  }
  return make_error(ErrorCode::kNotFound, "SEI message", "the access unit carries none of ours");
}

}  // namespace sightline
