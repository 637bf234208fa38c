// SPDX-License-Identifier: Apache-2.0
// One camera's video by WebRTC: asked by WHEP (an offer in one POST, the answer in its reply), ended by DELETE.

export interface VideoListener {
  /** A frame is shown; the age that the browser knows of it [ms], or NaN. */
  frame(age: number): void;
  /** It ended or never came; `refused`: asking again is of no use. */
  failed(refused: boolean): void;
}

const FIRST_MS = 8000;   // until the first frame
const SILENT_MS = 5000;  // without a frame, later; a camera without a signal still sends two a second

type FrameVideo = HTMLVideoElement & {
  requestVideoFrameCallback?(callback: (now: number, data: { captureTime?: number }) => void): number;
};

export function canPlayVideo(): boolean {
  return typeof RTCPeerConnection === "function" && "requestVideoFrameCallback" in HTMLVideoElement.prototype;
}

export class VideoPlayer {
  private readonly connection = new RTCPeerConnection();
  private session = "";  // its address, once there is one
  private over = false;
  private heard = performance.now();
  private frames = 0;
  private readonly timer: number;

  constructor(private readonly camera: string, private readonly video: FrameVideo, private readonly listener: VideoListener) {
    this.timer = window.setInterval(() => this.watch(), 500);
    this.connection.addEventListener("connectionstatechange", () => {
      if (this.connection.connectionState === "failed") this.fail(false);
    });
    this.connection.addEventListener("track", (event) => {
      // As soon as they can be decoded; what this holds back it holds back for even motion.
      (event.receiver as RTCRtpReceiver & { jitterBufferTarget?: number | null }).jitterBufferTarget = 0;
      video.srcObject = new MediaStream([event.track]);
      video.play().catch(() => undefined);  // it is watched anyway
      this.nextFrame();
    });
    void this.start();
  }

  private async start(): Promise<void> {
    try {
      this.connection.addTransceiver("video", { direction: "recvonly" });
      await this.connection.setLocalDescription();
      // The daemon needs no candidates of ours: it is we who call.
      const answer = await fetch(`cameras/${encodeURIComponent(this.camera)}/whep`, {
        method: "POST", headers: { "Content-Type": "application/sdp" }, body: this.connection.localDescription?.sdp ?? "",
      });
      if (answer.status !== 201) return this.fail(answer.status === 501 || answer.status === 400);
      this.session = new URL(answer.headers.get("Location") ?? "", answer.url).href;
      const sdp = await answer.text();
      if (this.over) return this.leave();
      await this.connection.setRemoteDescription({ type: "answer", sdp });
    } catch {
      this.fail(false);
    }
  }

  private nextFrame(): void {
    this.video.requestVideoFrameCallback?.((now, data) => {
      if (this.over) return;
      ++this.frames;
      this.heard = performance.now();
      this.listener.frame(data.captureTime === undefined ? NaN : now - data.captureTime);
      this.nextFrame();
    });
  }

  private watch(): void {
    if (performance.now() - this.heard > (this.frames > 0 ? SILENT_MS : FIRST_MS)) this.fail(false);
  }

  private fail(refused: boolean): void {
    if (this.over) return;
    this.close();
    this.listener.failed(refused);
  }

  /** `told` false: the daemon has ended it by itself. */
  close(told = true): void {
    if (!told) this.session = "";
    this.over = true;
    clearInterval(this.timer);
    this.connection.close();
    this.video.srcObject = null;
    this.leave();
  }

  private leave(): void {
    if (!this.session) return;
    // Also while the page goes away.
    fetch(this.session, { method: "DELETE", keepalive: true }).catch(() => undefined);
    this.session = "";
  }
}

const AGAIN_MS = 15_000;

/** Videos of those cameras that can be had; says which are left to pictures. */
export class VideoFeed {
  private readonly players = new Map<string, VideoPlayer>();
  private readonly resting = new Set<string>();  // tried again later
  private wanted: string[] = [];
  private refused = false;

  constructor(private readonly surface: (camera: string) => HTMLVideoElement | null,
              private readonly frame: (camera: string, age: number) => void,
              private readonly without: (cameras: string[]) => void) {
    window.addEventListener("pagehide", () => this.watch([]));
  }

  watch(cameras: string[]): void {
    this.wanted = cameras;
    for (const [name, player] of this.players) {
      if (cameras.includes(name)) continue;
      player.close(this.surface(name) !== null);  // else that camera has gone, and its sessions with it
      this.players.delete(name);
    }
    for (const name of cameras) if (!this.players.has(name) && !this.resting.has(name)) this.play(name);
    this.tell();
  }

  private play(name: string): void {
    const video = this.surface(name);
    if (!video || this.refused) return;
    this.players.set(name, new VideoPlayer(name, video, {
      frame: (age) => this.frame(name, age),
      failed: (refused) => this.rest(name, refused),
    }));
  }

  private rest(name: string, refused: boolean): void {
    this.players.delete(name);
    this.refused ||= refused;
    this.resting.add(name);
    this.tell();
    setTimeout(() => {
      this.resting.delete(name);
      if (this.wanted.includes(name)) this.watch(this.wanted);
    }, AGAIN_MS);
  }

  private tell(): void {
    this.without(this.wanted.filter((name) => !this.players.has(name)));
  }
}
