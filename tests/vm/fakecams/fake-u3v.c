// SPDX-License-Identifier: Apache-2.0
// A USB3 Vision camera without hardware: GenCP registers, a small GenICam
// description, Mono8 and BayerRG8 frames of any size up to 1280x1024. Aravis
// finds and drives it through libusb like a real one.
//
//   fake-u3v [-s serial] [-d ppm] WHERE                       (WHERE: see usbhost.h)
//
// -d  the device clock runs this many parts per million fast; it starts at 0
//     when the camera is plugged in, as on a real camera.
// Commands on standard input: unplug, freeze, thaw, cut N, stall (see fake-uvc.c), and
//   garbage N          overwrite the leader of the next N frames
#include "usbhost.h"

enum { CTL_IN = 0x81, CTL_OUT = 0x01, DATA = 0x82 };
enum { SBRM = 0x1000, SIRM = 0x2000, MANIFEST = 0x3000, XML = 0x10000, REG = 0x30000 };
enum {
  R_WIDTH = REG,
  R_HEIGHT = REG + 4,
  R_FORMAT = REG + 8,
  R_RATE = REG + 12,
  R_EXPOSURE = REG + 16,
  R_MODE = REG + 20,
  R_RUN = REG + 24,
  R_LATCH = REG + 28,
  R_STAMP = REG + 32
};
static uint8_t mem[0x40000];  // the camera's address space
static double plug_time, drift = 1;

static void put32(uint32_t a, uint32_t v) { memcpy(mem + a, &v, 4); }
static void put64(uint32_t a, uint64_t v) { memcpy(mem + a, &v, 8); }
static void putf(uint32_t a, float v) { memcpy(mem + a, &v, 4); }
static uint32_t get32(uint32_t a) {
  uint32_t v;
  memcpy(&v, mem + a, 4);
  return v;
}
static float getf(uint32_t a) {
  float v;
  memcpy(&v, mem + a, 4);
  return v;
}
static uint64_t device_time(void) { return (uint64_t)((now() - plug_time) * drift * 1e9); }

static char* xml_end;
__attribute__((format(printf, 1, 2))) static void xml(const char* f, ...) {
  va_list a;
  va_start(a, f);
  xml_end += vsprintf(xml_end, f, a);
  va_end(a);
}
static void xml_int_reg(const char* name, uint32_t a, int len, const char* mode) {
  xml("<IntReg "
      "Name=\"%sReg\"><Address>0x%x</Address><Length>%d</Length><AccessMode>%s</"
      "AccessMode><pPort>Device</pPort>"
      "<Sign>Unsigned</Sign><Endianess>LittleEndian</Endianess></IntReg>",
      name, a, len, mode);
}
static void xml_int(const char* name, uint32_t a, int len, const char* mode, int max) {
  xml("<Integer Name=\"%s\" NameSpace=\"Standard\"><pValue>%sReg</pValue>", name, name);
  if (max) xml("<Min>16</Min><Max>%d</Max><Inc>4</Inc>", max);
  xml("</Integer>");
  xml_int_reg(name, a, len, mode);
}
static void xml_float(const char* name, uint32_t a, double lo, double hi) {
  xml("<Float Name=\"%s\" "
      "NameSpace=\"Standard\"><pValue>%sReg</pValue><Min>%g</Min><Max>%g</Max></Float><FloatReg "
      "Name=\"%sReg\"><Address>0x%x</Address>"
      "<Length>4</Length><AccessMode>RW</AccessMode><pPort>Device</pPort><Endianess>LittleEndian</"
      "Endianess></FloatReg>",
      name, name, lo, hi, name, a);
}
static void xml_enum(const char* name, uint32_t a, const char* e0, uint32_t v0, const char* e1,
                     uint32_t v1) {
  xml("<Enumeration Name=\"%s\" NameSpace=\"Standard\"><EnumEntry "
      "Name=\"%s\"><Value>%u</Value></EnumEntry><EnumEntry "
      "Name=\"%s\"><Value>%u</Value></EnumEntry>"
      "<pValue>%sReg</pValue></Enumeration>",
      name, e0, v0, e1, v1, name);
  xml_int_reg(name, a, 4, "RW");
}
static void xml_command(const char* name, const char* reg, int value) {
  xml("<Command Name=\"%s\" "
      "NameSpace=\"Standard\"><pValue>%sReg</pValue><CommandValue>%d</CommandValue></Command>",
      name, reg, value);
}
static void describe(void) {
  const uint8_t d[18] = {18, 1, 0, 2, 0xEF, 2, 1, 64, 0x6b, 0x1d, 0x03, 0x01, 0, 1, 1, 2, 3, 1};
  memcpy(usb_device, d, 18);
  usb_eps[usb_n_eps++] = (struct usb_ep){CTL_IN, 0};
  usb_eps[usb_n_eps++] = (struct usb_ep){DATA, 1};
  usb_eps[usb_n_eps++] = (struct usb_ep){CTL_OUT, 0};
  usb_n_ifs = 2;
  for (int i = 0; i < 2; i++) usb_ifs[i].cls = 0xEF, usb_ifs[i].sub = 5;
  usb_ifs[1].proto = 2;
  USB_DESC(9, 2, 0, 0, 2, 1, 0, 0x80, 250);
  USB_DESC(8, 11, 0, 2, 0xEF, 5, 0, 0);
  USB_DESC(9, 4, 0, 0, 2, 0xEF, 5, 0, 0);
  USB_DESC(20, 0x24, 1, 0, 1, 0, 0, 0, 1, 0, 0, 4, 1, 2, 0, 0, 0, 3, 1,
           0);  // strings: 4 GUID, 1 vendor, 2 model, 3 serial
  USB_DESC(7, 5, CTL_IN, 2, LE16(512), 0);
  USB_DESC(7, 5, CTL_OUT, 2, LE16(512), 0);
  USB_DESC(9, 4, 1, 0, 1, 0xEF, 5, 2, 0);
  USB_DESC(7, 5, DATA, 2, LE16(512), 0);
  usb_config[2] = (uint8_t)usb_config_len;
  usb_config[3] = (uint8_t)(usb_config_len >> 8);

  put32(0, 0x10000);
  strcpy((char*)mem + 4, usb_strings[1]);
  strcpy((char*)mem + 0x44, usb_strings[2]);
  strcpy((char*)mem + 0x144, usb_strings[3]);
  put32(0x1cc, 200);
  put64(0x1d0, MANIFEST);
  put64(0x1d8, SBRM);
  put64(0x1fc, 1);
  put32(SBRM, 0x10000);
  put32(SBRM + 0x14, 1024);
  put32(SBRM + 0x18, 1024);
  put32(SBRM + 0x1c, 1);
  put64(SBRM + 0x20, SIRM);
  put32(SBRM + 0x28, 0x30);
  put32(SBRM + 0x40, 4);
  put32(SIRM, 2u << 24);
  put32(SIRM + 0x10, 52);
  put32(SIRM + 0x14, 32);
  put64(SIRM + 8, 640 * 360);
  put32(R_WIDTH, 640);
  put32(R_HEIGHT, 360);
  put32(R_FORMAT, 0x01080001);
  putf(R_RATE, 30);
  putf(R_EXPOSURE, 5000);

  xml_end = (char*)mem + XML;
  xml("<?xml version=\"1.0\"?><RegisterDescription ModelName=\"FakeU3V\" VendorName=\"VMrig\" "
      "StandardNameSpace=\"None\" SchemaMajorVersion=\"1\" "
      "SchemaMinorVersion=\"1\" SchemaSubMinorVersion=\"0\" MajorVersion=\"1\" MinorVersion=\"0\" "
      "SubMinorVersion=\"0\" ToolTip=\"\" ProductGuid=\"0\" "
      "VersionGuid=\"0\" xmlns=\"http://www.genicam.org/GenApi/Version_1_1\"><Category "
      "Name=\"Root\">");
  const char* f[] = {"DeviceVendorName",
                     "DeviceModelName",
                     "DeviceSerialNumber",
                     "OffsetX",
                     "OffsetY",
                     "Width",
                     "Height",
                     "PixelFormat",
                     "PayloadSize",
                     "AcquisitionMode",
                     "AcquisitionStart",
                     "AcquisitionStop",
                     "AcquisitionFrameRate",
                     "ExposureTime",
                     "TimestampLatch",
                     "TimestampLatchValue"};
  for (size_t i = 0; i < sizeof f / sizeof *f; i++) xml("<pFeature>%s</pFeature>", f[i]);
  xml("</Category>");
  const struct {
    const char* name;
    uint32_t a;
  } text[] = {{"DeviceVendorName", 0x4}, {"DeviceModelName", 0x44}, {"DeviceSerialNumber", 0x144}};
  for (int i = 0; i < 3; i++)
    xml("<StringReg Name=\"%s\" "
        "NameSpace=\"Standard\"><Address>0x%x</Address><Length>64</Length><AccessMode>RO</"
        "AccessMode><pPort>Device</pPort></StringReg>",
        text[i].name, text[i].a);
  xml("<Integer Name=\"OffsetX\" NameSpace=\"Standard\"><Value>0</Value></Integer><Integer "
      "Name=\"OffsetY\" NameSpace=\"Standard\"><Value>0</Value></Integer>");
  xml_int("Width", R_WIDTH, 4, "RW", 1280);
  xml_int("Height", R_HEIGHT, 4, "RW", 1024);
  xml_int("PayloadSize", SIRM + 8, 8, "RO", 0);
  xml_enum("PixelFormat", R_FORMAT, "Mono8", 0x01080001, "BayerRG8", 0x01080009);
  xml_enum("AcquisitionMode", R_MODE, "Continuous", 0, "SingleFrame", 1);
  xml_float("AcquisitionFrameRate", R_RATE, 1, 200);
  xml_float("ExposureTime", R_EXPOSURE, 10, 1e6);
  xml_int_reg("Run", R_RUN, 4, "RW");
  xml_command("AcquisitionStart", "Run", 1);
  xml_command("AcquisitionStop", "Run", 0);
  xml_int_reg("Latch", R_LATCH, 4, "RW");
  xml_command("TimestampLatch", "Latch", 1);
  xml_int("TimestampLatchValue", R_STAMP, 8, "RO", 0);
  xml("<Port Name=\"Device\" NameSpace=\"Standard\"></Port></RegisterDescription>");
  put64(MANIFEST, 1);
  put32(MANIFEST + 8, 1u << 24);
  put64(MANIFEST + 16, XML);
  put64(MANIFEST + 24, (uint64_t)(xml_end - (char*)mem - XML));
}

static uint8_t ack[8][1100];
static uint32_t ack_len[8];
static int acks;
static enum { LEADER, PAYLOAD, TRAILER } stage;
static uint64_t frame_no;
static uint32_t pos;
static double next_frame;
static uint8_t* img;
static int frozen, cut_n, garbage_n, stall_n;

static int usb_control(const uint8_t s[8], uint8_t* d, uint32_t* n) {
  (void)s;
  (void)d;
  (void)n;
  return -EPIPE;
}
static void usb_halt_cleared(uint8_t ep) {
  if (ep == DATA) stage = LEADER;
}
static void usb_out(uint8_t ep, const uint8_t* p, uint32_t n) {  // one GenCP command
  if (ep != CTL_OUT || n < 20 || acks == 8) return;
  uint16_t cmd, size, id, status = 0, len = 0, payload = 0;
  uint64_t a;
  uint32_t magic = 0x43563355;
  memcpy(&cmd, p + 6, 2);
  memcpy(&size, p + 8, 2);
  memcpy(&id, p + 10, 2);
  memcpy(&a, p + 12, 8);
  uint8_t* k = ack[acks];
  memset(k, 0, 16);
  memcpy(k, &magic, 4);
  if (cmd == 0x800) {
    memcpy(&len, p + 22, 2);
    if (len > 1024 || a + len > sizeof mem)
      status = 0x8003;
    else {
      if (a <= 0x1f0 && a + len > 0x1f0) put64(0x1f0, device_time());
      memcpy(k + 12, mem + a, len);
      payload = len;
    }
  } else if (cmd == 0x802) {
    len = (uint16_t)(size - 8);
    if (n < 20u + len || a + len > sizeof mem || (a >= XML && a < REG))
      status = 0x8003;
    else {
      memcpy(mem + a, p + 20, len);
      if (a == R_WIDTH || a == R_HEIGHT)
        put64(SIRM + 8, (uint64_t)get32(R_WIDTH) * get32(R_HEIGHT));
      if (a == R_LATCH) put64(R_STAMP, device_time());
      if (a == R_RUN) {
        note("acquisition %s", get32(R_RUN) ? "on" : "off");
        next_frame = now();
      }
      payload = 4;
      memcpy(k + 14, &len, 2);
    }
  } else
    status = 0x8001;
  cmd++;
  memcpy(k + 4, &status, 2);
  memcpy(k + 6, &cmd, 2);
  memcpy(k + 8, &payload, 2);
  memcpy(k + 10, &id, 2);
  ack_len[acks++] = 12u + payload;
}
static void pump(void) {
  while (usb_in[0].n && acks) {
    usb_answer(0, 0, ack[0], ack_len[0]);
    acks--;
    memmove(ack, ack + 1, sizeof ack[0] * (size_t)acks);
    memmove(ack_len, ack_len + 1, sizeof ack_len[0] * (size_t)acks);
  }
  if (!(get32(SIRM + 4) & 1) || !get32(R_RUN)) {
    stage = LEADER;
    return;
  }
  while (usb_in[1].n) {
    if (stall_n) {
      stall_n = 0;
      note("stalled");
      usb_answer(1, -EPIPE, 0, 0);
      continue;
    }
    uint32_t w = get32(R_WIDTH), h = get32(R_HEIGHT), bytes = w * h, magic;
    uint8_t l[52] = {0};
    if (stage == LEADER) {
      double t = now(), period = 1 / getf(R_RATE);
      if (frozen || t < next_frame) return;
      next_frame += period;
      if (next_frame < t) next_frame = t + period;
      if (!(img = realloc(img, bytes))) abort();
      for (uint32_t i = 0; i < bytes; i++) img[i] = (uint8_t)(i % w + frame_no);
      uint64_t ts = device_time();
      uint16_t size = 52, type = 1;
      magic = 0x4c563355;
      memcpy(l, &magic, 4);
      memcpy(l + 6, &size, 2);
      memcpy(l + 8, &frame_no, 8);
      memcpy(l + 18, &type, 2);
      memcpy(l + 20, &ts, 8);
      memcpy(l + 28, mem + R_FORMAT, 4);
      memcpy(l + 32, &w, 4);
      memcpy(l + 36, &h, 4);
      if (garbage_n > 0) {
        garbage_n--;
        memset(l, 0xA5, sizeof l);
        note("garbage before frame %llu", (unsigned long long)frame_no);
      }
      usb_answer(1, 0, l, 52);
      stage = PAYLOAD;
      pos = 0;
    } else if (stage == PAYLOAD) {
      uint32_t n = bytes - pos;
      if (n > usb_in[1].q[0].len) n = usb_in[1].q[0].len;
      if (cut_n > 0) {
        cut_n--;
        n /= 2;
        pos = bytes - n;
        note("frame %llu cut", (unsigned long long)frame_no);
      }
      usb_answer(1, 0, img + pos, n);
      pos += n;
      if (pos >= bytes) stage = TRAILER;
    } else {
      uint64_t size64 = bytes;
      uint16_t size = 32;
      magic = 0x54563355;
      memcpy(l, &magic, 4);
      memcpy(l + 6, &size, 2);
      memcpy(l + 8, &frame_no, 8);
      memcpy(l + 20, &size64, 8);
      usb_answer(1, 0, l, 32);
      stage = LEADER;
      frame_no++;
    }
  }
}
int main(int argc, char** argv) {
  usb_strings[1] = "VM rig";
  usb_strings[2] = "Fake U3V camera";
  usb_strings[3] = "U3V01";
  int o;
  while ((o = getopt(argc, argv, "s:d:")) != -1) {
    if (o == 's')
      usb_strings[3] = optarg;
    else if (o == 'd')
      drift = 1 + atof(optarg) * 1e-6;
    else
      return 2;
  }
  if (optind >= argc) {
    fprintf(stderr, "usage: fake-u3v [-s serial] [-d ppm] socket|vhci:N\n");
    return 2;
  }
  static char guid[32];
  unsigned hash = 5381;
  for (const char* c = usb_strings[3]; *c; c++) hash = hash * 33 + (unsigned char)*c;
  snprintf(guid, sizeof guid, "1D6B%08X", hash);
  usb_strings[4] = guid;
  setvbuf(stderr, NULL, _IOLBF, 0);
  snprintf(usb_name, sizeof usb_name, "fake-u3v %s", usb_strings[3]);
  plug_time = now();
  describe();
  if (!usb_plug(argv[optind])) return 1;
  for (;;) {
    char in[256];
    int ms = -1;
    if (usb_in[1].n && get32(R_RUN) && !frozen) {
      double d = stage == LEADER ? next_frame - now() : 0;
      ms = d > 0 ? (int)(d * 1000) + 1 : 0;
    }
    if (!usb_wait(ms, in, sizeof in)) return 0;
    char *save, *t;
    for (t = strtok_r(in, "\n", &save); t; t = strtok_r(NULL, "\n", &save)) {
      char w[16] = "";
      int v = 1;
      sscanf(t, "%15s %d", w, &v);
      note("command: %s", t);
      if (!strcmp(w, "unplug"))
        return 0;
      else if (!strcmp(w, "freeze"))
        frozen = 1;
      else if (!strcmp(w, "thaw"))
        frozen = 0, next_frame = now();
      else if (!strcmp(w, "cut"))
        cut_n = v;
      else if (!strcmp(w, "garbage"))
        garbage_n = v;
      else if (!strcmp(w, "stall"))
        stall_n = 1;
      else
        note("unknown command");
    }
    pump();
  }
}
