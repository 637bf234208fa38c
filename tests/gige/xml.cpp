// SPDX-License-Identifier: Apache-2.0
// The camera's description for GenICam clients (GenApi schema 1.1), feature names as in the SFNC.
#include <fmt/format.h>

#include <initializer_list>
#include <utility>

#include "pattern.hpp"
#include "registers.hpp"

namespace sightline::gige {
namespace {

using Entries = std::initializer_list<std::pair<const char*, uint32_t>>;

// Writes nodes and remembers which features are in which category.
class Writer {
 public:
  void category(std::string_view name) {
    close();
    category_ = name;
    categories_ += fmt::format("<pFeature>{}</pFeature>", name);
  }

  /// `more` goes into the feature's node: limits, selectors, locks.
  void integer(std::string_view name, uint32_t address, std::string_view more = "",
               std::string_view access = "RW", int length = 4) {
    node("Integer", name, pointer(name) + std::string(more));
    int_register(name, address, access, length);
  }
  void number(std::string_view name, uint32_t address, double low, double high,
              std::string_view unit) {
    node(
        "Float", name,
        fmt::format("{}<Min>{}</Min><Max>{}</Max><Unit>{}</Unit>", pointer(name), low, high, unit));
    body_ += fmt::format(
        "<FloatReg Name=\"{0}Reg\"><Address>{1:#x}</Address><Length>8</Length>"
        "<AccessMode>RW</AccessMode><pPort>Device</pPort><Cachable>NoCache</Cachable>"
        "<Endianess>BigEndian</Endianess></FloatReg>\n",
        name, address);
  }
  void boolean(std::string_view name, uint32_t address, std::string_view index = "") {
    node("Boolean", name, pointer(name) + "<OnValue>1</OnValue><OffValue>0</OffValue>");
    int_register(name, address, "RW", 4, index);
  }
  void command(std::string_view name, uint32_t address, uint32_t value) {
    node("Command", name, pointer(name) + fmt::format("<CommandValue>{}</CommandValue>", value));
    int_register(name, address, "RW", 4);
  }
  void text(std::string_view name, uint32_t address, size_t length, std::string_view access) {
    feature(name);
    body_ += fmt::format(
        "<StringReg Name=\"{}\"><Address>{:#x}</Address><Length>{}</Length>"
        "<AccessMode>{}</AccessMode><pPort>Device</pPort><Cachable>NoCache</Cachable>"
        "</StringReg>\n",
        name, address, length, access);
  }
  template <typename Range>
  void enumeration(std::string_view name, uint32_t address, const Range& entries,
                   std::string_view more = "", std::string_view access = "RW",
                   std::string_view index = "") {
    std::string inner;
    for (const auto& [entry, value] : entries) {
      inner += fmt::format("<EnumEntry Name=\"{}\"><Value>{}</Value></EnumEntry>", entry, value);
    }
    node("Enumeration", name, inner + pointer(name) + std::string(more));
    int_register(name, address, access, 4, index);
  }
  void chunk(std::string_view name, Chunk id, bool is_float) {
    node(is_float ? "Float" : "Integer", name, pointer(name));
    body_ += fmt::format(
        "<{0} Name=\"{1}Reg\"><Address>0</Address><Length>8</Length><AccessMode>RO</AccessMode>"
        "<pPort>{1}Port</pPort><Cachable>NoCache</Cachable>{2}<Endianess>BigEndian</Endianess>"
        "</{0}>\n<Port Name=\"{1}Port\"><ChunkID>{3:02X}</ChunkID></Port>\n",
        is_float ? "FloatReg" : "IntReg", name, is_float ? "" : "<Sign>Unsigned</Sign>",
        static_cast<uint32_t>(id));
  }
  void raw(std::string_view text) { body_ += text; }
  void feature(std::string_view name) { features_ += fmt::format("<pFeature>{}</pFeature>", name); }

  std::string document() {
    close();
    return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
           "<RegisterDescription ModelName=\"GigE\" VendorName=\"Simulated\" "
           "StandardNameSpace=\"GEV\" SchemaMajorVersion=\"1\" SchemaMinorVersion=\"1\" "
           "SchemaSubMinorVersion=\"0\" MajorVersion=\"1\" MinorVersion=\"0\" "
           "SubMinorVersion=\"0\" ToolTip=\"Simulated camera\" "
           "ProductGuid=\"3d5e4f60-8a11-4f0e-9b1c-5a6f0c7d1e01\" "
           "VersionGuid=\"3d5e4f60-8a11-4f0e-9b1c-5a6f0c7d1e02\" "
           "xmlns=\"http://www.genicam.org/GenApi/Version_1_1\" "
           "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
           "xsi:schemaLocation=\"http://www.genicam.org/GenApi/Version_1_1 "
           "GenApiSchema.xsd\">\n"
           "<Category Name=\"Root\" NameSpace=\"Standard\">" +
           categories_ + "</Category>\n" + body_ +
           "<Port Name=\"Device\" NameSpace=\"Standard\"/>\n</RegisterDescription>\n";
  }

 private:
  static std::string pointer(std::string_view name) {
    return fmt::format("<pValue>{}Reg</pValue>", name);
  }
  void node(std::string_view kind, std::string_view name, std::string_view inner) {
    feature(name);
    body_ += fmt::format("<{0} Name=\"{1}\" NameSpace=\"Standard\">{2}</{0}>\n", kind, name, inner);
  }
  void int_register(std::string_view name, uint32_t address, std::string_view access, int length,
                    std::string_view index = "") {
    body_ += fmt::format(
        "<IntReg Name=\"{}Reg\"><Address>{:#x}</Address>{}<Length>{}</Length>"
        "<AccessMode>{}</AccessMode><pPort>Device</pPort><Cachable>NoCache</Cachable>"
        "<Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>\n",
        name, address, index, length, access);
  }
  void close() {
    if (!category_.empty()) {
      body_ += fmt::format("<Category Name=\"{}\" NameSpace=\"Standard\">{}</Category>\n",
                           category_, features_);
    }
    features_.clear();
  }

  std::string categories_, body_, category_, features_;
};

void device_features(Writer& w, bool without_latch) {
  w.category("DeviceControl");
  w.text("DeviceVendorName", reg::kVendor, 32, "RO");
  w.text("DeviceModelName", reg::kModel, 32, "RO");
  w.text("DeviceVersion", reg::kDeviceVersion, 32, "RO");
  w.text("DeviceManufacturerInfo", reg::kInfo, 48, "RO");
  w.text("DeviceSerialNumber", reg::kSerial, 16, "RO");
  w.text("DeviceID", reg::kSerial, 16, "RO");
  w.text("DeviceUserID", reg::kUserName, 16, "RW");
  if (without_latch) return;
  w.command("TimestampReset", reg::kTimestampControl, 1);
  w.command("TimestampLatch", reg::kTimestampControl, 2);
  w.integer("TimestampLatchValue", reg::kLatchedHigh, "", "RO", 8);
}

void format_features(Writer& w, int width, int height) {
  w.category("ImageFormatControl");
  const auto limits = [](int low, int high, int step) {
    return fmt::format("<Min>{}</Min><Max>{}</Max><Inc>{}</Inc>", low, high, step);
  };
  w.integer("SensorWidth", reg::kSensorWidth, "", "RO");
  w.integer("SensorHeight", reg::kSensorHeight, "", "RO");
  w.integer("Width", reg::kWidth, limits(16, width, 4));
  w.integer("Height", reg::kHeight, limits(16, height, 2));
  w.integer("OffsetX", reg::kOffsetX, limits(0, width - 16, 4));
  w.integer("OffsetY", reg::kOffsetY, limits(0, height - 16, 2));
  std::vector<std::pair<std::string_view, uint32_t>> formats;
  for (const WireFormat& format : wire_formats()) formats.emplace_back(format.name, format.code);
  w.enumeration("PixelFormat", reg::kPixelFormat, formats);
}

void acquisition_features(Writer& w) {
  w.category("AcquisitionControl");
  w.enumeration("AcquisitionMode", reg::kAcquisitionMode,
                Entries{{"Continuous", 0}, {"SingleFrame", 1}, {"MultiFrame", 2}});
  w.command("AcquisitionStart", reg::kAcquisition, 1);
  w.command("AcquisitionStop", reg::kAcquisition, 2);
  w.integer("AcquisitionFrameCount", reg::kFrameCount, "<Min>1</Min><Max>65535</Max>");
  w.number("AcquisitionFrameRate", reg::kFrameRate, 0.1, 1000, "Hz");
  w.boolean("AcquisitionFrameRateEnable", reg::kFrameRateEnable);
  w.number("ExposureTime", reg::kExposureTime, 10, 1e7, "us");
  w.enumeration("ExposureAuto", reg::kExposureAuto,
                Entries{{"Off", 0}, {"Once", 1}, {"Continuous", 2}});
  w.enumeration("TriggerSelector", reg::kTriggerSelector, Entries{{"FrameStart", 0}});
  w.enumeration("TriggerMode", reg::kTriggerMode, Entries{{"Off", 0}, {"On", 1}});
  w.enumeration("TriggerSource", reg::kTriggerSource,
                Entries{{"Software", 0}, {"Line1", 1}, {"Line2", 2}, {"Action1", 3}});
  w.enumeration("TriggerActivation", reg::kTriggerActivation,
                Entries{{"RisingEdge", 0}, {"FallingEdge", 1}});
  w.number("TriggerDelay", reg::kTriggerDelay, 0, 1e6, "us");
  w.command("TriggerSoftware", reg::kTriggerSoftware, 1);
  w.category("AnalogControl");
  w.number("Gain", reg::kGain, 0, 24, "dB");
  w.enumeration("GainAuto", reg::kGainAuto, Entries{{"Off", 0}, {"Once", 1}, {"Continuous", 2}});
}

void line_features(Writer& w) {
  w.category("DigitalIOControl");
  w.enumeration("LineSelector", reg::kLineSelector, Entries{{"Line1", 0}, {"Line2", 1}},
                "<pSelected>LineMode</pSelected><pSelected>LineSource</pSelected>");
  constexpr std::string_view kIndex = "<pIndex Offset=\"4\">LineSelectorReg</pIndex>";
  w.enumeration("LineMode", reg::kLineMode, Entries{{"Input", 0}, {"Output", 1}}, "", "RW", kIndex);
  w.enumeration("LineSource", reg::kLineSource, Entries{{"Off", 0}, {"ExposureActive", 1}}, "",
                "RW", kIndex);
}

void transport_features(Writer& w, bool without_latch) {
  w.category("TransportLayerControl");
  w.integer("PayloadSize", reg::kPayloadSize, "", "RO");
  w.integer("GevHeartbeatTimeout", reg::kHeartbeat, "<Min>500</Min><Max>60000</Max>");
  w.integer("GevTimestampTickFrequency", reg::kTickHigh, "", "RO", 8);
  if (!without_latch) {
    w.command("GevTimestampControlReset", reg::kTimestampControl, 1);
    w.command("GevTimestampControlLatch", reg::kTimestampControl, 2);
    w.integer("GevTimestampValue", reg::kLatchedHigh, "", "RO", 8);
  }
  w.integer("GevSCPHostPort", reg::kStreamPort);
  w.integer("GevSCPD", reg::kPacketDelay);
  w.integer("GevSCDA", reg::kStreamAddress);
  w.feature("GevSCPSPacketSize");
  w.feature("GevSCPSFireTestPacket");
  w.feature("GevSCPSDoNotFragment");
  constexpr std::string_view kTail =
      "<Length>4</Length><AccessMode>RW</AccessMode><pPort>Device</pPort>"
      "<Cachable>NoCache</Cachable>";
  w.raw(fmt::format(
      "<Integer Name=\"GevSCPSPacketSize\" NameSpace=\"Standard\">"
      "<pValue>GevSCPSPacketSizeReg</pValue><Min>576</Min><Max>16260</Max><Inc>4</Inc></Integer>\n"
      "<MaskedIntReg Name=\"GevSCPSPacketSizeReg\"><Address>{0:#x}</Address>{1}<LSB>31</LSB>"
      "<MSB>16</MSB><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></MaskedIntReg>\n"
      "<Command Name=\"GevSCPSFireTestPacket\" NameSpace=\"Standard\">"
      "<pValue>GevSCPSFireTestPacketReg</pValue><CommandValue>1</CommandValue></Command>\n"
      "<MaskedIntReg Name=\"GevSCPSFireTestPacketReg\"><Address>{0:#x}</Address>{1}<Bit>0</Bit>"
      "<Endianess>BigEndian</Endianess></MaskedIntReg>\n"
      "<Boolean Name=\"GevSCPSDoNotFragment\" NameSpace=\"Standard\">"
      "<pValue>GevSCPSDoNotFragmentReg</pValue><OnValue>1</OnValue><OffValue>0</OffValue>"
      "</Boolean>\n"
      "<MaskedIntReg Name=\"GevSCPSDoNotFragmentReg\"><Address>{0:#x}</Address>{1}<Bit>1</Bit>"
      "<Endianess>BigEndian</Endianess></MaskedIntReg>\n",
      reg::kPacketSize, kTail));
  w.boolean("GevGVSPExtendedIDMode", reg::kExtendedIds);
  w.boolean("PtpEnable", reg::kPtpEnable);
  w.enumeration("PtpStatus", reg::kPtpStatus,
                Entries{{"Disabled", 0},
                        {"Listening", 1},
                        {"Uncalibrated", 2},
                        {"Slave", 3},
                        {"Master", 4},
                        {"Faulty", 5}},
                "", "RO");
  w.command("PtpDataSetLatch", reg::kPtpLatch, 1);
  w.raw(fmt::format(
      "<Integer Name=\"PtpOffsetFromMaster\" NameSpace=\"Standard\">"
      "<pValue>PtpOffsetFromMasterReg</pValue></Integer>\n"
      "<IntReg Name=\"PtpOffsetFromMasterReg\"><Address>{:#x}</Address><Length>8</Length>"
      "<AccessMode>RO</AccessMode><pPort>Device</pPort><Cachable>NoCache</Cachable>"
      "<Sign>Signed</Sign><Endianess>BigEndian</Endianess></IntReg>\n",
      reg::kPtpOffset));
  w.feature("PtpOffsetFromMaster");
}

void chunk_features(Writer& w) {
  w.category("ChunkDataControl");
  w.boolean("ChunkModeActive", reg::kChunkMode);
  w.enumeration("ChunkSelector", reg::kChunkSelector,
                Entries{{"Image", 0}, {"Timestamp", 1}, {"ExposureTime", 2}, {"FrameID", 3}},
                "<pSelected>ChunkEnable</pSelected>");
  w.boolean("ChunkEnable", reg::kChunkEnable, "<pIndex Offset=\"4\">ChunkSelectorReg</pIndex>");
  w.chunk("ChunkTimestamp", Chunk::kTimestamp, false);
  w.chunk("ChunkExposureTime", Chunk::kExposureTime, true);
  w.chunk("ChunkFrameID", Chunk::kFrameId, false);
}

void action_features(Writer& w) {
  w.category("ActionControl");
  w.integer("ActionDeviceKey", reg::kActionDeviceKey);
  w.integer("ActionSelector", reg::kActionSelector, "<Min>0</Min><Max>0</Max>");
  w.integer("ActionGroupKey", reg::kGroupKey);
  w.integer("ActionGroupMask", reg::kGroupMask);
}

}  // namespace

std::string camera_xml(int sensor_width, int sensor_height, bool without_latch) {
  Writer w;
  device_features(w, without_latch);
  format_features(w, sensor_width, sensor_height);
  acquisition_features(w);
  line_features(w);
  transport_features(w, without_latch);
  chunk_features(w);
  action_features(w);
  return w.document();
}

}  // namespace sightline::gige
