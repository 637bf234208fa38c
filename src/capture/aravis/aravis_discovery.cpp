// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/aravis_discovery.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <optional>
#include <tuple>

#include "capture/aravis/aravis_close.hpp"
#include "capture/aravis/gvcp.hpp"
#include "sightline/base/time.hpp"
#include "sightline/base/unique_fd.hpp"

namespace sightline::capture {
namespace {

constexpr uint16_t kGvcpPort = 3956;
// Aravis takes 2.75 s to find out that nobody is there.
constexpr Duration kAnswerWithin = std::chrono::milliseconds(600);

// Aravis keeps one list of devices for the process and no lock on it.
std::mutex& list_mutex() {
  static std::mutex mutex;
  return mutex;
}

std::vector<FoundCamera> read_list() {
  arv_update_device_list();
  std::vector<FoundCamera> cameras;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    FoundCamera camera;
    camera.id = text_or_empty(arv_get_device_id(i));
    camera.physical = text_or_empty(arv_get_device_physical_id(i));
    camera.vendor = text_or_empty(arv_get_device_vendor(i));
    camera.model = text_or_empty(arv_get_device_model(i));
    camera.serial = text_or_empty(arv_get_device_serial_nbr(i));
    camera.gige = text_or_empty(arv_get_device_protocol(i)) == "GigEVision";
    if (camera.gige) camera.address = text_or_empty(arv_get_device_address(i));
    cameras.push_back(std::move(camera));
  }
  // A camera that is seen through several interfaces is listed once for each.
  const auto key = [](const FoundCamera& c) { return std::tie(c.id, c.address, c.physical); };
  std::sort(cameras.begin(), cameras.end(),
            [&](const FoundCamera& a, const FoundCamera& b) { return key(a) < key(b); });
  const auto same = [&](const FoundCamera& a, const FoundCamera& b) { return key(a) == key(b); };
  cameras.erase(std::unique(cameras.begin(), cameras.end(), same), cameras.end());
  return cameras;
}

// "interface:NAME/ID" in its parts.
struct CameraName {
  std::string interface;
  std::string id;
};

CameraName split(const std::string& id) {
  constexpr std::string_view kPrefix = "interface:";
  if (!id.starts_with(kPrefix)) return {"", id};
  const size_t slash = id.find('/');
  if (slash == std::string::npos) return {"", id};
  return {id.substr(kPrefix.size(), slash - kPrefix.size()), id.substr(slash + 1)};
}

bool is_ipv4(const std::string& text) {
  in_addr parsed{};
  return inet_pton(AF_INET, text.c_str(), &parsed) == 1;
}

std::string to_text(const in_addr& address) {
  char text[INET_ADDRSTRLEN] = "";
  inet_ntop(AF_INET, &address, text, sizeof text);
  return text;
}

// Our address on the named interface.
std::optional<std::string> address_of_interface(const std::string& interface) {
  if (is_ipv4(interface)) return interface;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return std::nullopt;
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(list, &freeifaddrs);
  for (const ifaddrs* i = list; i != nullptr; i = i->ifa_next) {
    if (i->ifa_addr == nullptr || i->ifa_addr->sa_family != AF_INET) continue;
    if (interface == i->ifa_name) {
      return to_text(reinterpret_cast<const sockaddr_in*>(i->ifa_addr)->sin_addr);
    }
  }
  return std::nullopt;
}

// Our address on the way to the camera. Aravis would take the interface on which the camera was
// first seen, which is another one where two reach it.
std::optional<std::string> address_towards(const std::string& camera) {
  const UniqueFd socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_in peer{};
  peer.sin_family = AF_INET;
  peer.sin_port = htons(kGvcpPort);
  inet_pton(AF_INET, camera.c_str(), &peer.sin_addr);
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&peer), sizeof peer) != 0) {
    return std::nullopt;
  }
  sockaddr_in own{};
  socklen_t size = sizeof own;
  if (getsockname(socket.get(), reinterpret_cast<sockaddr*>(&own), &size) != 0) return std::nullopt;
  return to_text(own.sin_addr);
}

Error cannot_open(const std::string& name, const std::string& what, const ErrorSlot& slot) {
  const std::string text = slot.text();
  if (text.find("ccess denied") != std::string::npos ||
      text.find("ermission") != std::string::npos ||
      text.find("LIBUSB_ERROR_ACCESS") != std::string::npos) {
    return make_error(ErrorCode::kUnavailable, name,
                      "no permission to open {}: {} (a USB3 Vision camera needs a udev rule that "
                      "gives the service's group access to its USB device)",
                      what, text);
  }
  return make_error(ErrorCode::kUnavailable, name, "cannot open {}: {}", what, text);
}

Result<ObjectRef<ArvCamera>> camera_of(ObjectRef<ArvDevice> device, const std::string& what,
                                       const std::string& name) {
  ErrorSlot slot;
  ObjectRef<ArvCamera> camera(arv_camera_new_with_device(device.get(), slot.out()));
  if (!camera) return cannot_open(name, what, slot);
  return camera;
}

Error absent(const std::string& address, const std::string& own, const std::string& name,
             const std::string& why) {
  return make_error(ErrorCode::kUnavailable, name,
                    "no camera answers at {} (asked from {}): {}. Is it powered, in this subnet, "
                    "and not behind a firewall?",
                    address, own, why);
}

Result<ObjectRef<ArvCamera>> connect_gige(const std::string& address, const std::string& interface,
                                          const std::string& name) {
  const auto own = interface.empty() ? address_towards(address) : address_of_interface(interface);
  if (!own) {
    if (interface.empty()) {
      return make_error(ErrorCode::kUnavailable, name,
                        "no route to the camera at {}: is the network interface up?", address);
    }
    return make_error(ErrorCode::kUnavailable, name,
                      "network interface {} is not there or has no IPv4 address", interface);
  }
  if (!ask_gige(address, *own, kAnswerWithin)) return absent(address, *own, name, "no answer");
  const ObjectRef<GInetAddress> from(g_inet_address_new_from_string(own->c_str()));
  const ObjectRef<GInetAddress> to(g_inet_address_new_from_string(address.c_str()));
  ErrorSlot slot;
  ObjectRef<ArvDevice> device;
  {
    std::lock_guard lock(description_mutex());
    device.reset(arv_gv_device_new(from.get(), to.get(), slot.out()));
  }
  if (!device) return absent(address, *own, name, slot.text());
  if (!arv_gv_device_is_controller(ARV_GV_DEVICE(device.get()))) {
    close_in_background(std::move(device));
    return make_error(ErrorCode::kUnavailable, name,
                      "the camera at {} is controlled by another client: stop that program (a "
                      "crashed one loses control after the camera's heartbeat time-out)",
                      address);
  }
  return camera_of(std::move(device), address, name);
}

Result<ObjectRef<ArvCamera>> connect_usb(const FoundCamera& found, const std::string& name) {
  std::scoped_lock lock(list_mutex(), description_mutex());
  ErrorSlot slot;
  ObjectRef<ArvDevice> device(arv_open_device(found.id.c_str(), slot.out()));
  if (!device) return cannot_open(name, found.id, slot);
  return camera_of(std::move(device), found.id, name);
}

bool matches(const FoundCamera& camera, const std::string& id) {
  return id == camera.id || id == camera.serial || id == camera.physical || id == camera.address;
}

// The name that a user wrote into a camera is not in Aravis' list.
bool has_user_name(const FoundCamera& camera, const std::string& user_name) {
  if (!camera.gige) return false;
  const auto own = address_towards(camera.address);
  const auto answer = own ? ask_gige(camera.address, *own, kAnswerWithin) : std::nullopt;
  return answer && answer->user_name == user_name;
}

// Where a camera was that is named by something else than its address. It is asked there first: a
// discovery takes a second, and misses a camera that comes back in the middle of it.
struct KnownAddress {
  std::string address;
  uint32_t misses = 0;
};
constexpr uint32_t kMissesPerDiscovery = 4;
std::mutex known_mutex;

std::map<std::string, KnownAddress>& known_addresses() {
  static std::map<std::string, KnownAddress> known;
  return known;
}

void remember(const std::string& id, const std::string& address) {
  std::lock_guard lock(known_mutex);
  known_addresses()[id] = {address, 0};
}

// nullopt: not known, answered by another camera, or silent so often that it may have moved.
std::optional<Result<ObjectRef<ArvCamera>>> connect_known(const CameraName& requested,
                                                          const std::string& name) {
  std::string address;
  uint32_t misses = 0;
  {
    std::lock_guard lock(known_mutex);
    const auto found = known_addresses().find(requested.id);
    if (found == known_addresses().end()) return std::nullopt;
    address = found->second.address;
    misses = found->second.misses++;
  }
  const auto own = requested.interface.empty() ? address_towards(address)
                                               : address_of_interface(requested.interface);
  if (!own) return std::nullopt;
  const auto answer = ask_gige(address, *own, kAnswerWithin);
  if (!answer) {
    if (misses % kMissesPerDiscovery == kMissesPerDiscovery - 1) return std::nullopt;
    return absent(address, *own, name, "no answer");
  }
  const std::string id = answer->vendor + "-" + answer->model + "-" + answer->serial;
  if (requested.id != answer->serial && requested.id != answer->user_name && requested.id != id) {
    return std::nullopt;
  }
  remember(requested.id, address);
  return connect_gige(address, requested.interface, name);
}

}  // namespace

std::vector<FoundCamera> discover_aravis() {
  static std::vector<FoundCamera> latest;
  static Time started{};
  const Time asked = MonotonicClock::now();
  std::lock_guard lock(list_mutex());
  // Somebody else's discovery that began after we asked is as good as ours.
  if (started < asked) {
    started = MonotonicClock::now();
    latest = read_list();
  }
  return latest;
}

std::string to_string(const std::vector<FoundCamera>& cameras) {
  std::string text;
  for (const FoundCamera& camera : cameras) {
    if (!text.empty()) text += ", ";
    text += camera.id;
    if (!camera.address.empty()) text += " at " + camera.address;
  }
  return text.empty() ? "no GigE Vision or USB3 Vision camera answers" : text;
}

Result<ObjectRef<ArvCamera>> connect_aravis(const FoundCamera& found, const std::string& interface,
                                            const std::string& name) {
  if (found.gige) return connect_gige(found.address, interface, name);
  return connect_usb(found, name);
}

Result<ObjectRef<ArvCamera>> connect_aravis(const std::string& id, const std::string& name) {
  const CameraName requested = split(id);
  if (requested.id.empty()) {
    return make_error(ErrorCode::kInvalidInput, name,
                      "which camera? Write source = \"aravis:ID\"; `sightline cameras` lists them");
  }
  if (is_ipv4(requested.id)) return connect_gige(requested.id, requested.interface, name);
  if (auto connected = connect_known(requested, name)) return *std::move(connected);
  const std::vector<FoundCamera> cameras = discover_aravis();
  std::vector<const FoundCamera*> found;
  for (const FoundCamera& camera : cameras) {
    if (matches(camera, requested.id)) found.push_back(&camera);
  }
  if (found.empty()) {
    for (const FoundCamera& camera : cameras) {
      if (has_user_name(camera, requested.id)) found.push_back(&camera);
    }
  }
  if (found.empty()) {
    return make_error(ErrorCode::kUnavailable, name,
                      "no camera with id, serial, MAC or user-defined name '{}'; {}{}",
                      requested.id, cameras.empty() ? "" : "seen: ", to_string(cameras));
  }
  if (found.size() > 1) {
    return make_error(ErrorCode::kInvalidInput, name,
                      "'{}' names {} cameras; seen: {}. Use the address or the whole id",
                      requested.id, found.size(), to_string(cameras));
  }
  if (found.front()->gige) remember(requested.id, found.front()->address);
  return connect_aravis(*found.front(), requested.interface, name);
}

}  // namespace sightline::capture
