// SPDX-License-Identifier: Apache-2.0
// A GigE Vision camera in software: `gige_simulator --help`. It speaks the protocols from the
// standards alone, so that a test of the program's Aravis source is not Aravis tested with itself.
#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <sstream>

#include "camera.hpp"
#include "control.hpp"

namespace {

using namespace sightline::gige;

volatile sig_atomic_t g_stop = 0;

void request_stop(int) { g_stop = 1; }

// Faults and events by name, from the command line ("--set loss=0.01") and from standard input
// ("loss 0.01").
class Commands {
 public:
  Commands(Faults& faults, Camera& camera, Control& control, Registers& registers) {
    share("loss", faults.loss);
    share("resend-loss", faults.resend_loss);
    share("reorder", faults.reorder);
    share("duplicate", faults.duplicate);
    share("no-leader", faults.no_leader);
    share("no-trailer", faults.no_trailer);
    share("short-leader", faults.short_leader);
    share("wrong-size", faults.wrong_size);
    microseconds("reorder-us", faults.reorder_ns);
    microseconds("delay-us", faults.delay_ns);
    microseconds("jitter-us", faults.jitter_ns);
    microseconds("stamp-jitter-us", faults.stamp_jitter_ns);
    microseconds("answer-us", faults.answer_ns);
    flag("silent", faults.silent);
    flag("no-stamp", faults.no_stamp);
    flag("deaf", faults.deaf);
    named_["resend"] = [&](double v) {
      faults.resend =
          v > 1 ? Faults::Resend::kRefuse : (v > 0 ? Faults::Resend::kOn : Faults::Resend::kOff);
    };
    named_["drift-ppm"] = [&](double v) { camera.clock().set_drift(v, host_now_ns()); };
    named_["clock-reset"] = [&](double) { camera.clock().reset(host_now_ns()); };
    named_["clock-jump-ms"] = [&](double v) { camera.clock().jump(static_cast<int64_t>(v * 1e6)); };
    named_["clock-wrap-ticks"] = [&](double v) {
      camera.clock().set_wrap(static_cast<uint64_t>(v));
    };
    named_["frame-id"] = [&](double v) { camera.set_next_id(static_cast<uint64_t>(v)); };
    named_["rate"] = [&](double v) { camera.set_rate(v); };
    named_["drop-control"] = [&](double) { control.drop_control(); };
    named_["pending"] = [&](double v) { control.set_pending(static_cast<int>(v)); };
    named_["line"] = [&](double v) {
      camera.trigger(v > 1 ? Camera::Trigger::kLine2 : Camera::Trigger::kLine1, host_now_ns());
    };
    named_["extended-ids"] = [&](double v) { registers.set_u32(reg::kExtendedIds, v > 0); };
  }

  bool run(const std::string& name, double value) const {
    const auto found = named_.find(name);
    if (found == named_.end()) return false;
    found->second(value);
    return true;
  }
  std::string names() const {
    std::string text;
    for (const auto& [name, action] : named_) text += (text.empty() ? "" : ", ") + name;
    return text;
  }

 private:
  void share(const char* name, double& field) {
    named_[name] = [&field](double v) { field = v; };
  }
  void microseconds(const char* name, int64_t& field) {
    named_[name] = [&field](double v) { field = static_cast<int64_t>(v * 1e3); };
  }
  void flag(const char* name, bool& field) {
    named_[name] = [&field](double v) { field = v > 0; };
  }

  std::map<std::string, std::function<void(double)>> named_;
};

void fill_bootstrap(Registers& r, const CameraOptions& options, in_addr address, uint16_t port,
                    size_t xml_size, const std::string& vendor) {
  r.set_u32(reg::kVersion, 2u << 16);
  r.set_u32(reg::kDeviceMode, 1u << 31 | 1);  // big endian, UTF-8
  r.set_u32(reg::kMacHigh, 0x0200);
  r.set_u32(reg::kMacLow, ntohl(address.s_addr));
  r.set_u32(reg::kIpSupported, 7);
  r.set_u32(reg::kIpCurrent, 5);
  r.set_u32(reg::kAddress, ntohl(address.s_addr));
  r.set_u32(reg::kMask, 0xFF000000);
  r.set_text(reg::kVendor, 32, vendor);
  r.set_text(reg::kModel, 32, options.model);
  r.set_text(reg::kDeviceVersion, 32, "1.0");
  r.set_text(reg::kInfo, 48, "a camera in software");
  r.set_text(reg::kSerial, 16, options.serial);
  r.set_text(reg::kUserName, 16, options.user_name);
  r.set_text(reg::kXmlUrl, 512, fmt::format("Local:simulator.xml;{:x};{:x}", reg::kXml, xml_size));
  r.set_u32(reg::kInterfaces, 1);
  r.set_u32(reg::kStreamChannels, 1);
  r.set_u32(reg::kActionSignals, 1);
  // Named: user name, serial number, heartbeat; action, pending answer, resend, memory, several.
  r.set_u32(reg::kCapability, 7u << 29 | 1u << 6 | 1u << 5 | 1u << 2 | 1u << 1 | 1u);
  r.set_u32(reg::kHeartbeat, 3000);
  r.set_u32(reg::kTickHigh, static_cast<uint32_t>(options.tick_hz >> 32));
  r.set_u32(reg::kTickLow, static_cast<uint32_t>(options.tick_hz));
  r.set_u32(reg::kPacketSize, 1400);
  r.set_u32(reg::kStreamSource, port);
  r.set_u32(reg::kGroupMask, 0xFFFFFFFF);
}

// Lines "NAME [VALUE]"; each is answered by "ok NAME" or "unknown NAME".
void read_commands(const Commands& commands, std::string& unread, bool& open) {
  std::array<char, 1024> bytes;
  const ssize_t got = ::read(STDIN_FILENO, bytes.data(), bytes.size());
  if (got == 0) open = false;
  if (got <= 0) return;
  unread.append(bytes.data(), static_cast<size_t>(got));
  for (size_t end = 0; (end = unread.find('\n')) != std::string::npos;) {
    std::istringstream line(unread.substr(0, end));
    unread.erase(0, end + 1);
    std::string name;
    double value = 1;
    line >> name;
    if (!(line >> value)) value = 1;
    fmt::print("{} {}\n", commands.run(name, value) ? "ok" : "unknown", name);
    std::fflush(stdout);
  }
}

void sleep_until_due(int64_t due_ns, const Control& control, bool with_input) {
  std::array<pollfd, 4> wait{};
  size_t count = 0;
  for (const int socket : control.sockets()) {
    if (socket >= 0) wait[count++] = {socket, POLLIN, 0};
  }
  if (with_input) wait[count++] = {STDIN_FILENO, POLLIN, 0};
  const int64_t left = std::clamp<int64_t>(due_ns - host_now_ns(), 0, 100'000'000);
  const timespec timeout{0, left};
  ::ppoll(wait.data(), count, &timeout, nullptr);
}

void serve(Camera& camera, Streamer& streamer, Control& control, const Commands& commands) {
  std::string unread;
  bool input = true;
  (void)::fcntl(STDIN_FILENO, F_SETFL, ::fcntl(STDIN_FILENO, F_GETFL) | O_NONBLOCK);
  bool streaming = false;
  while (g_stop == 0) {
    control.run();
    const int64_t now = host_now_ns();
    if (input) read_commands(commands, unread, input);
    control.check_heartbeat(now);
    camera.run(now);
    streamer.run(host_now_ns());
    if (camera.streaming() != streaming) {
      streaming = !streaming;
      fmt::print("{} resent={}\n", streaming ? "streaming" : "stopped", streamer.resent());
      std::fflush(stdout);
    }
    sleep_until_due(std::min(camera.next_due(), streamer.next_due()), control, input);
  }
}

struct Arguments {
  CameraOptions camera;
  std::string address = "127.0.0.1", vendor = "Simulated";
  std::vector<std::string> settings;
  uint64_t seed = 1;
};

void define(CLI::App& app, Arguments& a) {
  app.add_option("--address", a.address, "IPv4 address of this host that the camera answers at");
  app.add_option("--vendor", a.vendor, "DeviceVendorName");
  app.add_option("--model", a.camera.model, "DeviceModelName");
  app.add_option("--serial", a.camera.serial, "DeviceSerialNumber");
  app.add_option("--user-name", a.camera.user_name, "DeviceUserID");
  app.add_option("--width", a.camera.width, "of the sensor")->check(CLI::Range(16, 8192));
  app.add_option("--height", a.camera.height, "of the sensor")->check(CLI::Range(16, 8192));
  app.add_option("--format", a.camera.pixel_format, "PixelFormat at the start");
  app.add_option("--rate", a.camera.rate_hz, "Hz");
  app.add_option("--exposure-us", a.camera.exposure_us, "ExposureTime at the start");
  app.add_option("--readout-us", a.camera.readout_us,
                 "from the end of exposure to the first packet");
  app.add_option("--phase-ms", a.camera.phase_ms, "of the exposures, free-running");
  app.add_option("--line1-hz", a.camera.line1_hz,
                 "an outside trigger on Line1, at the same instants in all simulators");
  app.add_option("--tick-hz", a.camera.tick_hz, "of the time stamp counter");
  app.add_option("--drift-ppm", a.camera.drift_ppm, "of the camera's clock, frame rate included");
  app.add_option("--first-id", a.camera.first_id, "of the frames");
  app.add_option("--mtu", a.camera.mtu, "test packets above it get lost");
  app.add_flag("--stamp-end", a.camera.stamp_end, "stamps the end of exposure, not its start");
  app.add_flag("--no-latch", a.camera.without_latch, "no time-stamp latch and reset");
  app.add_flag("!--no-ptp-master", a.camera.ptp_master, "PTP finds nobody to follow");
  app.add_option(
      "--truth", a.camera.truth,
      "file: number, frame id, stamp (ns), start and end of exposure (CLOCK_MONOTONIC, ns)");
  app.add_option("--set", a.settings, "NAME=VALUE, see below; any number of times");
  app.add_option("--seed", a.seed, "of everything random");
}

int run(const Arguments& a, std::string& error) {
  in_addr address{};
  if (inet_pton(AF_INET, a.address.c_str(), &address) != 1) {
    error = a.address + " is no IPv4 address";
    return 2;
  }
  const std::string xml = camera_xml(a.camera.width, a.camera.height, a.camera.without_latch);
  Registers registers(xml);
  Faults faults;
  std::mt19937_64 random(a.seed);
  Streamer streamer(address, faults, random);
  fill_bootstrap(registers, a.camera, address, streamer.port(), xml.size(), a.vendor);
  Camera camera(a.camera, registers, streamer, faults, random);
  Control control(address, registers, camera, streamer, faults);
  const Commands commands(faults, camera, control, registers);
  for (const std::string& setting : a.settings) {
    const size_t equals = std::min(setting.find('='), setting.size());
    const std::string value = setting.substr(std::min(equals + 1, setting.size()));
    if (!commands.run(setting.substr(0, equals), value.empty() ? 1 : std::atof(value.c_str()))) {
      error = fmt::format("--set {}: known are {}", setting, commands.names());
      return 2;
    }
  }
  if (!control.open(error)) return 1;
  fmt::print("ready\n");
  std::fflush(stdout);
  serve(camera, streamer, control, commands);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("A GigE Vision camera in software.");
  app.footer(
      "--set and standard input: loss, resend-loss, reorder, duplicate (shares of packets); "
      "no-leader, no-trailer, short-leader, wrong-size (shares of frames); reorder-us, "
      "delay-us, jitter-us, stamp-jitter-us, answer-us; silent, deaf, no-stamp (0 or 1); resend (0 "
      "off, 1 on, 2 refused); drift-ppm, clock-reset, clock-jump-ms, clock-wrap-ticks; "
      "frame-id, extended-ids, rate, line, drop-control, pending");
  Arguments arguments;
  define(app, arguments);
  CLI11_PARSE(app, argc, argv);
  struct sigaction stop {};
  stop.sa_handler = request_stop;
  sigaction(SIGTERM, &stop, nullptr);
  sigaction(SIGINT, &stop, nullptr);
  std::string error;
  const int status = run(arguments, error);
  if (status != 0) fmt::print(stderr, "gige_simulator: {}\n", error);
  return status;
}
