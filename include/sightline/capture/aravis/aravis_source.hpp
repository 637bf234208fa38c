// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sightline/base/ids.hpp"
#include "sightline/base/result.hpp"
#include "sightline/capture/aravis/gige_action.hpp"
#include "sightline/capture/common/device_info.hpp"
#include "sightline/model/seams.hpp"

namespace sightline {

/// Where in the exposure the camera takes its time stamp (its manual says).
enum class ExposureStamp { kStart, kEnd };
enum class TriggerEdge { kAsIs, kRising, kFalling };

/// One GigE Vision or USB3 Vision camera. Zero, empty or nullopt: the camera's own setting stays.
struct AravisOptions {
  /// What `source = "aravis:ID"` names: a device id ("Vendor-Model-Serial", as list_aravis() has
  /// it), a serial number, a MAC (or USB GUID), the name that a user gave a GigE Vision camera, or
  /// an IPv4 address. With "interface:NAME/ID" only
  /// that network interface (name or its own address) is used. An address is asked directly,
  /// without discovery, through the interface that the route to it takes.
  std::string id;

  int width = 0, height = 0;       ///< both or neither
  int offset_x = 0, offset_y = 0;  ///< of the region, with width and height
  std::string pixel_format;        ///< as GenICam spells it: "Mono8", "BayerRG8", "Mono12Packed"
  double rate_hz = 0;              ///< refused above what the camera can
  double exposure_us = 0;          ///< switches automatic exposure off
  double gain = -1;                ///< in the camera's unit; < 0: not set
  /// "free"; "software": fired by this source, rate_hz times a second (0: by trigger() only); or
  /// what the camera calls it: "Line1", "Action1".
  std::string trigger = "free";
  TriggerEdge trigger_edge = TriggerEdge::kAsIs;
  double trigger_delay_us = -1;  ///< from the trigger to the exposure; < 0: not set
  std::string strobe;     ///< line that is high while the camera exposes, for others' triggers
  GigeActionKeys action;  ///< with trigger "Action1": the keys that it listens to
  ExposureStamp stamp = ExposureStamp::kStart;
  /// Least time from the stamp to the first packet at the host, where it was measured. < 0: taken
  /// as the exposure time, and the bound of each frame's time covers what that may be wrong by.
  double transit_us = -1;
  /// Asks the camera for the time on its clock now and then, where it can tell; then neither
  /// transit_us nor an assumption is needed.
  bool latch = true;
  bool chunks = true;  ///< exposure time and frame number with each image, where offered

  // GigE Vision only.
  int packet_size = 0;         ///< bytes; 0: negotiated
  int packet_delay_ns = -1;    ///< between packets; < 0: not set
  bool resend = true;          ///< ask for packets that are missing
  double resend_ratio = -1;    ///< most packets of a frame to ask for again, as a share; < 0: 0.25
  int packet_timeout_us = 0;   ///< after which a missing packet is asked for again; 0: 20 ms
  int frame_retention_us = 0;  ///< after which a frame is given up; 0: 100 ms
  int socket_buffer = 0;       ///< bytes; 0: as large as one frame needs
  bool packet_socket = true;   ///< used where the process may (CAP_NET_RAW)
  bool ptp = false;            ///< switches PTP on; its state is in AravisStatus

  int buffers = 8;  ///< 4..64
  /// Longest wait for a complete frame before the camera counts as lost; 0: max(0.8 s, 5 periods),
  /// 3 s where the rate is not known, and none for a camera that others trigger.
  Duration frame_timeout{0};

  bool operator==(const AravisOptions&) const = default;
};

/// Numbers of an open camera; they grow from its opening on.
struct AravisStatus {
  uint64_t delivered = 0;
  uint64_t lost = 0;             ///< by the camera's own frame numbers, incomplete ones included
  uint64_t incomplete = 0;       ///< missing packets, wrong size, aborted
  uint64_t unusable = 0;         ///< complete, but not the image that was agreed on
  uint64_t copied = 0;           ///< handed out as a copy, since readers held the buffers
  uint64_t triggers = 0;         ///< fired by this source
  uint64_t aborted = 0;          ///< frames given up after their last packet failed to come in time
  uint64_t resent_packets = 0;   ///< GigE Vision, as all of these
  uint64_t missing_packets = 0;  ///< never came
  uint64_t resend_requests = 0;  ///< packets asked for again
  uint64_t resend_refused = 0;   ///< frames whose packets the camera had no longer
  uint64_t resend_limited = 0;   ///< frames with more missing packets than resend_ratio admits
  uint64_t error_packets = 0, duplicate_packets = 0, ignored_packets = 0;
  uint64_t size_errors = 0;      ///< packets that were larger than the frame
  uint64_t underruns = 0;        ///< frames that found no buffer
  uint64_t stamps_rejected = 0;  ///< device times that made no sense
  uint64_t clock_resets = 0;
  double clock_drift = 0;  ///< of the device clock against the host's
  Duration clock_bound{0};
  std::string device_id;                 ///< "Vendor-Model-Serial"
  std::string pixel_format;              ///< in force, as GenICam spells it
  std::string ptp;                       ///< "Slave", "Master", ...; empty: off
  std::optional<int64_t> ptp_offset_ns;  ///< from the master, as the camera says
  int packet_size = 0;
  bool latched = false;  ///< the mapping comes from the camera's time-stamp latch
  bool chunks = false;   ///< exposure times and frame numbers come with the images
};

/// An open Aravis camera. next() returns an Error when the camera is gone (control lost, nothing
/// complete within the deadline); the caller destroys it, waits, and opens a new one. Frames that
/// are still held then stay valid.
class AravisSource : public FrameSource {
 public:
  /// From the thread that calls next().
  virtual AravisStatus status() const = 0;
  /// Fires a software trigger. From the thread that calls next().
  virtual Status trigger() = 0;
};

/// Opens, configures and starts the camera. Frames carry `epoch`, one more at every reopen. Takes
/// up to some seconds when the camera does not answer. Errors, with `where` = name: kUnavailable:
/// not found (the text says what was seen instead), controlled by another client, no permission, or
/// "built without Aravis"; kInvalidInput: a setting that the camera does not take; kTimeout: it
/// stopped answering. Any number of threads may open cameras at the same time. All of it is marked
/// as Waiting; after `stop` it gives up between two settings (kUnavailable).
Result<std::unique_ptr<AravisSource>> open_aravis_source(const AravisOptions& options,
                                                         CameraId camera, const std::string& name,
                                                         uint32_t epoch = 0,
                                                         const std::stop_token& stop = {});

/// All GigE Vision and USB3 Vision cameras that answer within a second. `formats`: opens each one
/// that nobody controls to ask for its formats and rates. Any thread. kUnavailable without Aravis.
Result<std::vector<DeviceInfo>> list_aravis(bool formats);

/// "Aravis 0.8.26", or "built without Aravis".
std::string aravis_version();

}  // namespace sightline
