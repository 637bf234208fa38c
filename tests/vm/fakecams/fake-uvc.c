// SPDX-License-Identifier: Apache-2.0
// A UVC webcam without hardware: MJPG and YUYV, 320x180 to 1280x720, 10-30 fps,
// bulk streaming, PTS/SCR time stamps, brightness, contrast, gain and exposure.
// The guest's own uvcvideo driver binds to it.
//
//   fake-uvc [-s serial] [-j directory with *.jpg] WHERE      (WHERE: see usbhost.h)
//
// Commands on standard input, one per line:
//   unplug             pull the cable (the program ends)
//   freeze / thaw      stop / resume sending frames
//   drop N             leave out the next N frames
//   cut N              send only half of each of the next N frames
//   error N            set the error bit in the next N frames
//   garbage N          overwrite a piece in the middle of the next N frames
//   stall              stall the streaming endpoint once
#include <glob.h>
#include "usbhost.h"

static const struct { uint16_t w, h; } sizes[] = {{320, 180}, {640, 360}, {1280, 720}};
static const uint32_t intervals[] = {333333, 400000, 666666, 1000000};  // 100 ns
enum { NSIZE = 3, NINT = 4, MJPG = 1, YUYV = 2, PAYLOAD = 16384, EP = 0x81 };

static struct {
  uint8_t* p;
  size_t n;
} jpg[256];
static int njpg;
static double start_time, next_frame;
static uint8_t probe[34], fid, *frame;
static int streaming, frozen, drop_n, cut_n, error_n, garbage_n, stall_n, frame_bad;
static size_t frame_len, frame_pos;
static uint32_t frame_no, frame_pts;

static void describe(void) {
  const uint8_t d[18] = {18, 1, 0, 2, 0xEF, 2, 1, 64, 0x6b, 0x1d, 0x02, 0x01, 0, 1, 1, 2, 3, 1};
  memcpy(usb_device, d, 18);
  usb_eps[usb_n_eps++] = (struct usb_ep){EP, 1};
  usb_n_ifs = 2;
  usb_ifs[0].cls = usb_ifs[1].cls = 0x0E;
  usb_ifs[0].sub = 1;
  usb_ifs[1].sub = 2;
  USB_DESC(9, 2, 0, 0, 2, 1, 0, 0x80, 250);
  USB_DESC(8, 11, 0, 2, 0x0E, 3, 0, 2);    // association
  USB_DESC(9, 4, 0, 0, 0, 0x0E, 1, 0, 2);  // control interface
  int vc = usb_config_len;
  USB_DESC(13, 0x24, 1, LE16(0x0110), 0, 0, LE32(48000000), 1, 1);  // header
  USB_DESC(18, 0x24, 2, 1, LE16(0x0201), 0, 0, 0, 0, 0, 0, 0, 0, 3, 8, 0,
           0);                                       // camera: exposure time
  USB_DESC(12, 0x24, 5, 2, 1, 0, 0, 3, 3, 2, 0, 0);  // unit: brightness, contrast, gain
  USB_DESC(9, 0x24, 3, 3, LE16(0x0101), 0, 2, 0);    // output
  usb_config[vc + 5] = (uint8_t)(usb_config_len - vc);
  usb_config[vc + 6] = (uint8_t)((usb_config_len - vc) >> 8);
  USB_DESC(9, 4, 1, 0, 1, 0x0E, 2, 0, 0);  // streaming interface
  int vs = usb_config_len;
  USB_DESC(15, 0x24, 1, 2, 0, 0, EP, 0, 3, 0, 0, 0, 1, 0, 0);
  for (int f = MJPG; f <= YUYV; f++) {
    if (f == MJPG)
      USB_DESC(11, 0x24, 6, MJPG, NSIZE, 0, 1, 0, 0, 0, 0);
    else
      USB_DESC(27, 0x24, 4, YUYV, NSIZE, 'Y', 'U', 'Y', '2', 0, 0, 0x10, 0, 0x80, 0, 0, 0xAA, 0,
               0x38, 0x9B, 0x71, 16, 1, 0, 0, 0, 0);
    for (int i = 0; i < NSIZE; i++) {
      uint32_t bytes = sizes[i].w * sizes[i].h * 2u;
      USB_DESC(26 + 4 * NINT, 0x24, f == MJPG ? 7 : 5, (uint8_t)(i + 1), 0, LE16(sizes[i].w),
               LE16(sizes[i].h), LE32(bytes * 80), LE32(bytes * 240), LE32(bytes),
               LE32(intervals[0]), NINT);
      for (int k = 0; k < NINT; k++) USB_DESC(LE32(intervals[k]));
    }
    USB_DESC(6, 0x24, 13, 1, 1, 4);  // colour matching
  }
  usb_config[vs + 4] = (uint8_t)(usb_config_len - vs);
  usb_config[vs + 5] = (uint8_t)((usb_config_len - vs) >> 8);
  USB_DESC(7, 5, EP, 2, LE16(512), 0);
  usb_config[2] = (uint8_t)usb_config_len;
  usb_config[3] = (uint8_t)(usb_config_len >> 8);
}

static uint32_t interval(void) {
  uint32_t v;
  memcpy(&v, probe + 4, 4);
  return v;
}
static void settle_probe(void) {  // make what the host asked for possible
  int i = probe[3] - 1;
  if (i < 0 || i >= NSIZE) i = 0, probe[3] = 1;
  if (probe[2] != MJPG && probe[2] != YUYV) probe[2] = MJPG;
  uint32_t want = interval(), best = intervals[0];
  for (int k = 0; k < NINT; k++)
    if (llabs((long long)intervals[k] - want) < llabs((long long)best - want)) best = intervals[k];
  uint32_t v[] = {sizes[i].w * sizes[i].h * 2u, PAYLOAD, 48000000};
  memcpy(probe + 4, &best, 4);
  memcpy(probe + 18, v, 12);
  probe[30] = 3;
  probe[31] = probe[32] = probe[33] = 0;
}
static void stop_stream(void) {
  if (streaming) note("stream off after %u frames", frame_no);
  streaming = 0;
  frame = NULL;
}
static void usb_halt_cleared(uint8_t ep) {
  if (ep == EP) stop_stream();
}  // how uvcvideo ends a bulk stream
static void usb_out(uint8_t ep, const uint8_t* d, uint32_t n) {
  (void)ep;
  (void)d;
  (void)n;
}

static int usb_control(const uint8_t s[8], uint8_t* data, uint32_t* n) {
  static int16_t level[16] = {[2] = 10, [3] = 20, [4] = 30};
  static uint32_t exposure = 100;
  uint8_t rq = s[1], cs = s[3], iface = s[4], unit = s[5];
  if (iface == 1) {  // probe (1) and commit (2)
    if (cs != 1 && cs != 2) return -EPIPE;
    memset(data + *n, 0, 34);
    switch (rq) {
      case 1:
        memcpy(probe, data, *n < 34 ? *n : 34);
        settle_probe();
        if (cs == 2) {
          streaming = 1;
          frozen = 0;
          frame = NULL;
          next_frame = now() + 0.02;
          note("stream on: %s %dx%d, %.1f fps", probe[2] == MJPG ? "MJPG" : "YUYV",
               sizes[probe[3] - 1].w, sizes[probe[3] - 1].h, 1e7 / interval());
        }
        return 0;
      case 0x81:
      case 0x82:
      case 0x83:
      case 0x87:
        memcpy(data, probe, 34);
        if (rq != 0x81) memcpy(data + 4, &intervals[rq == 0x83 ? NINT - 1 : 0], 4);
        *n = 34;
        return 0;
      case 0x85:
        data[0] = 34;
        data[1] = 0;
        *n = 2;
        return 0;
      case 0x86:
        data[0] = 3;
        *n = 1;
        return 0;
      default:
        return -EPIPE;
    }
  }
  if (unit == 2 && cs >= 2 && cs <= 4) {
    int16_t v = rq == 0x81 ? level[cs] : rq == 0x83 ? 255 : rq == 0x84 ? 1 : rq == 0x87 ? 32 : 0;
    if (rq == 1) {
      if (*n >= 2) memcpy(&level[cs], data, 2);
      return 0;
    }
    if (rq == 0x86)
      data[0] = 3, *n = 1;
    else if (rq == 0x85)
      data[0] = 2, data[1] = 0, *n = 2;
    else
      memcpy(data, &v, 2), *n = 2;
    return 0;
  }
  if (unit == 1 && cs == 4) {
    uint32_t v = rq == 0x81 ? exposure : rq == 0x83 ? 10000 : rq == 0x87 ? 100 : 1;
    if (rq == 1) {
      if (*n >= 4) memcpy(&exposure, data, 4);
      return 0;
    }
    if (rq == 0x86)
      data[0] = 3, *n = 1;
    else if (rq == 0x85)
      data[0] = 4, data[1] = 0, *n = 2;
    else
      memcpy(data, &v, 4), *n = 4;
    return 0;
  }
  return -EPIPE;
}

static void make_frame(void) {
  static uint8_t* buf;
  static size_t cap;
  int i = probe[3] - 1, use_jpg = probe[2] == MJPG && njpg;
  size_t n = use_jpg ? jpg[frame_no % (uint32_t)njpg].n : sizes[i].w * sizes[i].h * 2u;
  if (n > cap) {
    buf = realloc(buf, n);
    cap = n;
    if (!buf) abort();
  }
  if (use_jpg)
    memcpy(buf, jpg[frame_no % (uint32_t)njpg].p, n);
  else {
    for (size_t k = 0; k < n; k += 2)
      buf[k] = (uint8_t)(k / 2 % sizes[i].w + frame_no), buf[k + 1] = 0x80;
    memcpy(buf, &frame_no, 4);
  }
  frame = buf;
  frame_len = n;
  frame_pos = 0;
  frame_bad = 0;
  fid ^= 1;
  frame_pts = (uint32_t)(uint64_t)((now() - start_time) * 48e6);
  if (garbage_n > 0) {
    garbage_n--;
    for (size_t k = n / 3; k < n / 2; k++) buf[k] = (uint8_t)(k * 7);
    note("garbage in frame %u", frame_no);
  }
  if (cut_n > 0) {
    cut_n--;
    frame_len = n / 2;
    note("frame %u cut", frame_no);
  }
  if (error_n > 0) {
    error_n--;
    frame_bad = 1;
    note("error bit in frame %u", frame_no);
  }
  frame_no++;
}
static void pump(void) {  // answer waiting reads with payloads
  while (usb_in[0].n && streaming) {
    if (stall_n) {
      stall_n = 0;
      note("stalled");
      usb_answer(0, -EPIPE, 0, 0);
      continue;
    }
    if (!frame) {
      double t = now(), period = interval() * 1e-7;
      if (frozen || t < next_frame) return;
      next_frame += period;
      if (next_frame < t) next_frame = t + period;
      if (drop_n > 0) {
        drop_n--;
        note("frame %u dropped", frame_no++);
        continue;
      }
      make_frame();
    }
    static uint8_t b[PAYLOAD];
    uint32_t room = usb_in[0].q[0].len < PAYLOAD ? usb_in[0].q[0].len : PAYLOAD, n = room - 12;
    if (n > frame_len - frame_pos) n = (uint32_t)(frame_len - frame_pos);
    int last = frame_pos + n == frame_len;
    uint32_t stc = (uint32_t)(uint64_t)((now() - start_time) * 48e6);
    uint16_t sof = (uint16_t)((uint64_t)((now() - start_time) * 1000) & 2047);
    b[0] = 12;
    b[1] = (uint8_t)(0x8C | fid | (last ? 2 : 0) | (frame_bad ? 0x40 : 0));
    memcpy(b + 2, &frame_pts, 4);
    memcpy(b + 6, &stc, 4);
    memcpy(b + 10, &sof, 2);
    memcpy(b + 12, frame + frame_pos, n);
    frame_pos += n;
    usb_answer(0, 0, b, n + 12);
    if (last) frame = NULL;
  }
}
static void load(const char* dir) {
  char pat[512];
  glob_t g;
  snprintf(pat, sizeof pat, "%s/*.jpg", dir);
  if (glob(pat, 0, 0, &g)) return;
  for (size_t i = 0; i < g.gl_pathc && njpg < 256; i++) {
    FILE* f = fopen(g.gl_pathv[i], "rb");
    if (!f) continue;
    fseek(f, 0, SEEK_END);
    long n = ftell(f);
    rewind(f);
    if (n > 0 && (jpg[njpg].p = malloc((size_t)n))) {
      jpg[njpg].n = fread(jpg[njpg].p, 1, (size_t)n, f);
      njpg++;
    }
    fclose(f);
  }
  globfree(&g);
}
int main(int argc, char** argv) {
  usb_strings[1] = "VM rig";
  usb_strings[2] = "Fake UVC camera";
  usb_strings[3] = "0001";
  int o;
  while ((o = getopt(argc, argv, "s:j:")) != -1) {
    if (o == 's')
      usb_strings[3] = optarg;
    else if (o == 'j')
      load(optarg);
    else
      return 2;
  }
  if (optind >= argc) {
    fprintf(stderr, "usage: fake-uvc [-s serial] [-j directory] socket|vhci:N\n");
    return 2;
  }
  setvbuf(stderr, NULL, _IOLBF, 0);
  snprintf(usb_name, sizeof usb_name, "fake-uvc %s", usb_strings[3]);
  describe();
  settle_probe();
  start_time = now();
  if (!usb_plug(argv[optind])) return 1;
  for (;;) {
    char in[256];
    int ms = -1;
    if (streaming && !frozen && usb_in[0].n) {
      double d = frame ? 0 : next_frame - now();
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
      else if (!strcmp(w, "drop"))
        drop_n = v;
      else if (!strcmp(w, "cut"))
        cut_n = v;
      else if (!strcmp(w, "error"))
        error_n = v;
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
