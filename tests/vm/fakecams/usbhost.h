// SPDX-License-Identifier: Apache-2.0
// What a USB camera without hardware needs: one device, plugged either into
// QEMU's emulated xHCI controller (usbredir protocol over a unix socket; the
// program runs outside the guest) or into Linux' virtual USB/IP controller
// (vhci-hcd, over a socket pair; the program runs inside the guest as root).
//
// The device is described by plain descriptors and answers two kinds of
// requests: control transfers (usb_control) and bulk transfers. Bulk OUT data
// is handed to usb_out at once; bulk IN requests wait in usb_in[] until the
// device answers them with usb_answer. Ending the process pulls the cable.
#ifndef USBHOST_H
#define USBHOST_H
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

enum { USB_EP_MAX = 4, USB_WAITING = 64 };

// ---- provided by the camera
static uint8_t usb_device[18], usb_config[2048];
static int usb_config_len;
static const char* usb_strings[8];  // 1..7
struct usb_ep {
  uint8_t address, interface;
};  // bulk, 512 bytes
static struct usb_ep usb_eps[USB_EP_MAX];
static int usb_n_eps;
static struct { uint8_t cls, sub, proto; } usb_ifs[USB_EP_MAX];
static int usb_n_ifs;
static int usb_control(const uint8_t setup[8], uint8_t* data,
                       uint32_t* n);  // class requests; 0 or -errno
static void usb_out(uint8_t ep, const uint8_t* data, uint32_t n);
static void usb_halt_cleared(uint8_t ep);

// ---- provided to the camera
struct usb_request {
  uint64_t id;
  uint32_t len;
};
static struct {
  uint8_t ep;
  int n;
  struct usb_request q[USB_WAITING];
} usb_in[USB_EP_MAX];
static int usb_fd = -1;
static char usb_name[32] = "fake camera";

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}
__attribute__((format(printf, 1, 2))) static void note(const char* f, ...) {
  va_list a;
  va_start(a, f);
  fprintf(stderr, "%s %.3f ", usb_name, now());
  vfprintf(stderr, f, a);
  fputc('\n', stderr);
  va_end(a);
}
static void usb_append(const void* p, int n) {
  memcpy(usb_config + usb_config_len, p, (size_t)n);
  usb_config_len += n;
}
#define USB_DESC(...)                   \
  do {                                  \
    const uint8_t d_[] = {__VA_ARGS__}; \
    usb_append(d_, sizeof d_);          \
  } while (0)
#define LE16(x) (uint8_t)(x), (uint8_t)((x) >> 8)
#define LE32(x) \
  (uint8_t)(x), (uint8_t)((x) >> 8), (uint8_t)((x) >> 16), (uint8_t)((uint32_t)(x) >> 24)

// ---- the wire
static int usb_redir, usb_ids64, usb_len32;
static void usb_send(const void* p, size_t n) {
  while (n) {
    ssize_t k = send(usb_fd, p, n, MSG_NOSIGNAL);
    if (k < 0 && errno == EINTR) continue;
    if (k <= 0) {
      note("the host went away");
      exit(0);
    }
    p = (const char*)p + k;
    n -= (size_t)k;
  }
}
static int usb_recv(void* p, size_t n) {
  while (n) {
    ssize_t k = recv(usb_fd, p, n, 0);
    if (k < 0 && errno == EINTR) continue;
    if (k <= 0) return 0;
    p = (char*)p + k;
    n -= (size_t)k;
  }
  return 1;
}
static void usb_redir_send(uint32_t type, uint64_t id, const void* h, uint32_t hn, const void* d,
                           uint32_t dn) {
  uint8_t b[256];
  uint32_t t[2] = {type, hn + dn}, id32 = (uint32_t)id;
  size_t n = 8;
  memcpy(b, t, 8);
  if (usb_ids64)
    memcpy(b + n, &id, 8), n += 8;
  else
    memcpy(b + n, &id32, 4), n += 4;
  memcpy(b + n, h, hn);
  n += hn;
  usb_send(b, n);
  if (dn) usb_send(d, dn);
}
static void usb_bulk_reply(uint8_t ep, uint64_t id, int err, const void* data, uint32_t n,
                           uint32_t done) {
  if (usb_redir) {
    uint8_t status = err == 0 ? 0 : err == -EPIPE ? 4 : 1;
    uint8_t h[10] = {ep, status, LE16(done), 0, 0, 0, 0, LE16(done >> 16)};
    usb_redir_send(101, id, h, usb_len32 ? 10 : 8, data, n);
  } else {
    uint32_t h[12] = {htonl(3), (uint32_t)id,      0, 0, 0, htonl((uint32_t)err), htonl(done),
                      0,        htonl(0xffffffffu)};
    usb_send(h, sizeof h);
    if (n) usb_send(data, n);
  }
}
// Answers the oldest waiting IN request of endpoint slot s.
static void usb_answer(int s, int err, const void* data, uint32_t n) {
  usb_bulk_reply(usb_in[s].ep, usb_in[s].q[0].id, err, data, n, n);
  memmove(usb_in[s].q, usb_in[s].q + 1, sizeof usb_in[s].q[0] * (size_t)--usb_in[s].n);
}
static int usb_slot(uint8_t ep) {
  for (int i = 0; i < USB_EP_MAX; i++)
    if (usb_in[i].ep == ep) return i;
  return -1;
}
static int usb_forget(uint64_t id) {
  for (int s = 0; s < USB_EP_MAX; s++)
    for (int i = 0; i < usb_in[s].n; i++)
      if (usb_in[s].q[i].id == id) {
        memmove(usb_in[s].q + i, usb_in[s].q + i + 1,
                sizeof usb_in[s].q[0] * (size_t)(--usb_in[s].n - i));
        return s;
      }
  return -1;
}

static int usb_any_control(const uint8_t s[8], uint8_t* data,
                           uint32_t* n) {  // standard requests first
  uint8_t rt = s[0], rq = s[1];
  uint16_t val = (uint16_t)(s[2] | s[3] << 8), len = (uint16_t)(s[6] | s[7] << 8);
  if (rt & 0x60) {
    int e = usb_control(s, data, n);
    if (!e && (rt & 0x80) && *n > len) *n = len;
    return e;
  }
  uint8_t out[256] = {0};
  const void* src = out;
  uint32_t m = 0;
  switch (rq) {
    case 0:
      m = 2;
      break;
    case 1:
      if (rt == 2) usb_halt_cleared(s[4]);
      break;
    case 6: {
      uint8_t kind = (uint8_t)(val >> 8), i = (uint8_t)val;
      if (kind == 1)
        src = usb_device, m = 18;
      else if (kind == 2)
        src = usb_config, m = (uint32_t)usb_config_len;
      else if (kind == 3 && i == 0)
        memcpy(out, "\4\3\x09\4", 4), m = 4;
      else if (kind == 3 && i < 8 && usb_strings[i]) {
        const char* t = usb_strings[i];
        m = 2 + 2 * (uint32_t)strlen(t);
        out[0] = (uint8_t)m;
        out[1] = 3;
        for (uint32_t k = 0; t[k]; k++) out[2 + 2 * k] = (uint8_t)t[k];
      } else
        return -EPIPE;
      break;
    }
    case 8:
    case 10:
      out[0] = rq == 8;
      m = 1;
      break;
    default:
      break;
  }
  if (rt & 0x80) {
    *n = m < len ? m : len;
    memcpy(data, src, *n);
  }
  return 0;
}

static void usb_redir_describe(void) {
  uint8_t ii[132] = {(uint8_t)usb_n_ifs}, ep[160] = {0};
  for (int i = 0; i < usb_n_ifs; i++)
    ii[4 + i] = (uint8_t)i, ii[36 + i] = usb_ifs[i].cls, ii[68 + i] = usb_ifs[i].sub,
           ii[100 + i] = usb_ifs[i].proto;
  memset(ep, 255, 32);
  ep[0] = ep[16] = 0;
  ep[96] = ep[96 + 32] = 64;
  for (int i = 0; i < usb_n_eps; i++) {
    int k = (usb_eps[i].address & 15) + (usb_eps[i].address & 0x80 ? 16 : 0);
    ep[k] = 2;
    ep[64 + k] = usb_eps[i].interface;
    ep[96 + 2 * k + 1] = 2;  // bulk, 512
  }
  usb_redir_send(4, 0, ii, sizeof ii, 0, 0);
  usb_redir_send(5, 0, ep, sizeof ep, 0, 0);
}
static int usb_redir_packet(void) {
  static uint8_t d[1 << 20], data[65536], configuration;
  uint32_t t[2];
  uint64_t id = 0;
  if (!usb_recv(t, 8) || !usb_recv(&id, usb_ids64 ? 8 : 4) || t[1] > sizeof d ||
      (t[1] && !usb_recv(d, t[1])))
    return 0;
  switch (t[0]) {
    case 0: {
      uint32_t caps = 0;
      if (t[1] >= 68) memcpy(&caps, d + 64, 4);
      usb_ids64 = caps >> 5 & 1;
      usb_len32 = caps >> 6 & 1;
      usb_redir_describe();
      uint8_t c[10] = {2,
                       usb_device[4],
                       usb_device[5],
                       usb_device[6],
                       usb_device[8],
                       usb_device[9],
                       usb_device[10],
                       usb_device[11],
                       usb_device[12],
                       usb_device[13]};
      usb_redir_send(1, 0, c, 10, 0, 0);
      note("plugged in");
      break;
    }
    case 3:
      for (int s = 0; s < USB_EP_MAX; s++) usb_in[s].n = 0;
      break;
    case 6:
      configuration = d[0];
      usb_redir_describe(); /* fall through */
    case 7: {
      uint8_t r[2] = {0, configuration};
      usb_redir_send(8, id, r, 2, 0, 0);
      break;
    }
    case 9:
    case 10: {
      uint8_t r[3] = {0, d[0], 0};
      usb_redir_send(11, id, r, 3, 0, 0);
      break;
    }
    case 21: {
      int s = usb_forget(id);
      if (s >= 0) usb_bulk_reply(usb_in[s].ep, id, -ECONNRESET, 0, 0, 0);
      break;
    }
    case 100: {
      uint8_t setup[8] = {d[2], d[1], d[4], d[5], d[6], d[7], d[8], d[9]}, h[10];
      uint32_t m = d[2] & 0x80 ? 0 : t[1] - 10;
      if (m) memcpy(data, d + 10, m);
      int e = usb_any_control(setup, data, &m);
      if (e) m = 0;
      memcpy(h, d, 10);
      h[3] = e ? 4 : 0;
      h[8] = (uint8_t)m;
      h[9] = (uint8_t)(m >> 8);
      usb_redir_send(100, id, h, 10, data, d[2] & 0x80 ? m : 0);
      break;
    }
    case 101: {
      uint32_t hl = usb_len32 ? 10 : 8, len = d[2] | (uint32_t)d[3] << 8;
      if (usb_len32) len |= (uint32_t)(d[8] | d[9] << 8) << 16;
      int s = usb_slot(d[0]);
      if (!(d[0] & 0x80)) {
        usb_out(d[0], d + hl, t[1] - hl);
        usb_bulk_reply(d[0], id, 0, 0, 0, len);
      } else if (s >= 0 && usb_in[s].n < USB_WAITING)
        usb_in[s].q[usb_in[s].n++] = (struct usb_request){id, len};
      else
        usb_bulk_reply(d[0], id, -EPIPE, 0, 0, 0);
      break;
    }
    default:
      note("usbredir packet %u ignored", t[0]);
  }
  return 1;
}
static int usb_ip_packet(void) {
  static uint8_t data[65536];
  uint32_t h[12];
  if (!usb_recv(h, sizeof h)) return 0;
  uint32_t cmd = ntohl(h[0]), in = ntohl(h[3]), ep = ntohl(h[4]), len = ntohl(h[6]);
  if (cmd == 1) {
    if (len > sizeof data) {
      note("a transfer of %u bytes", len);
      return 0;
    }
    if (!in && len && !usb_recv(data, len)) return 0;
    int s = usb_slot((uint8_t)(ep | 0x80));
    if (ep == 0) {
      uint32_t m = in ? 0 : len;
      int e = usb_any_control((const uint8_t*)&h[10], data, &m);
      if (e) m = 0;
      usb_bulk_reply(0, h[1], e, data, in ? m : 0, m);
    } else if (!in) {
      usb_out((uint8_t)ep, data, len);
      usb_bulk_reply((uint8_t)ep, h[1], 0, 0, 0, len);
    } else if (s >= 0 && usb_in[s].n < USB_WAITING)
      usb_in[s].q[usb_in[s].n++] = (struct usb_request){h[1], len};
    else
      usb_bulk_reply((uint8_t)ep, h[1], -EPIPE, 0, 0, 0);
  } else if (cmd == 2) {
    uint32_t r[12] = {htonl(4), h[1], 0,
                      0,        0,    htonl((uint32_t)(usb_forget(h[5]) >= 0 ? -ECONNRESET : 0))};
    usb_send(r, sizeof r);
  }
  return 1;
}

// where: path of QEMU's usb-redir socket, or "vhci:N" for port N of vhci_hcd.0.
static int usb_plug(const char* where) {
  for (int i = 0, s = 0; i < usb_n_eps; i++)
    if (usb_eps[i].address & 0x80) usb_in[s++].ep = usb_eps[i].address;
  if (strncmp(where, "vhci:", 5)) {
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    if (strlen(where) >= sizeof a.sun_path) {
      fprintf(stderr, "%s: too long\n", where);
      return 0;
    }
    strcpy(a.sun_path, where);
    usb_fd = socket(AF_UNIX, SOCK_STREAM, 0);
    if (connect(usb_fd, (struct sockaddr*)&a, sizeof a)) {
      perror(where);
      return 0;
    }
    usb_redir = 1;
    uint8_t h[68] = "fake camera";
    uint32_t caps = 1u << 1 | 1u << 4 | 1u << 5 | 1u << 6;
    memcpy(h + 64, &caps, 4);
    usb_redir_send(0, 0, h, sizeof h, 0, 0);
    return 1;
  }
  int port = atoi(where + 5), sv[2], a = open("/sys/devices/platform/vhci_hcd.0/attach", O_WRONLY);
  if (a < 0) {
    perror("vhci_hcd (modprobe vhci-hcd)");
    return 0;
  }
  if (socketpair(AF_UNIX, SOCK_STREAM, 0, sv)) {
    perror("socketpair");
    return 0;
  }
  char line[64];
  int n = snprintf(line, sizeof line, "%d %d %d 3", port, sv[1], 1 << 16 | (port + 2));
  if (write(a, line, (size_t)n) != n) {
    perror("attach");
    return 0;
  }
  close(a);
  close(sv[1]);
  usb_fd = sv[0];
  note("plugged in");
  return 1;
}
// Waits at most ms for the host or for a line on standard input; handles what
// the host sent. Returns 0 when the host is gone. *line is set to input, if any.
static int usb_wait(int ms, char* line, size_t size) {
  static int input = 1;
  struct pollfd p[2] = {{usb_fd, POLLIN, 0}, {input ? 0 : -1, POLLIN, 0}};
  *line = 0;
  poll(p, 2, ms);
  if (p[1].revents) {
    ssize_t k = read(0, line, size - 1);
    if (k <= 0)
      input = 0;
    else
      line[k] = 0;
  }
  if (p[0].revents && !(usb_redir ? usb_redir_packet() : usb_ip_packet())) {
    note("the host closed");
    return 0;
  }
  return 1;
}
#endif
