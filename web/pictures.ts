// SPDX-License-Identifier: Apache-2.0
// All cameras' pictures in one connection: browsers open six to a server, and a rig may have more cameras than that.

export interface Picture { camera: string; utcNs: number; sequence: number; jpeg: Blob }

const CR = 13, LF = 10;
const LARGEST = 64 << 20;  // of one picture and what came behind it

/** Takes a multipart body apart as it comes. Parts have a Content-Length, as the daemon sends them. */
export class Parts {
  private bytes = new Uint8Array(1 << 18);
  private size = 0;

  add(chunk: Uint8Array): Picture[] {
    this.append(chunk);
    const out: Picture[] = [];
    for (let used = this.one(out); used > 0; used = this.one(out)) {
      this.bytes.copyWithin(0, used, this.size);
      this.size -= used;
    }
    return out;
  }

  private append(chunk: Uint8Array): void {
    const size = this.size + chunk.length;
    if (size > LARGEST) throw new Error("a picture without an end");
    if (size > this.bytes.length) {
      const larger = new Uint8Array(2 * size);
      larger.set(this.bytes.subarray(0, this.size));
      this.bytes = larger;
    }
    this.bytes.set(chunk, this.size);
    this.size = size;
  }

  /** Length of the part at the beginning once it is whole, else 0. */
  private one(out: Picture[]): number {
    const head = this.headEnd();
    if (head < 0) return 0;
    const text = new TextDecoder().decode(this.bytes.subarray(0, head));
    const field = (name: string) => new RegExp(`^${name}: (.*?)\\r?$`, "mi").exec(text)?.[1] ?? "";
    const length = Number(field("Content-Length"));
    if (!(length > 0)) throw new Error("a part without a length");
    const end = head + length;
    if (this.size < end) return 0;
    out.push({
      camera: field("X-Camera"), utcNs: Number(field("X-Utc-Ns")), sequence: Number(field("X-Sequence")),
      jpeg: new Blob([this.bytes.slice(head, end)], { type: "image/jpeg" }),
    });
    return end;
  }

  private headEnd(): number {
    const b = this.bytes;
    for (let i = 0; i + 3 < this.size; ++i) {
      // The empty line behind the headers, not the one before the boundary.
      if (b[i] === CR && b[i + 1] === LF && b[i + 2] === CR && b[i + 3] === LF && i > 0) return i + 4;
    }
    return -1;
  }
}

/** Pictures of some cameras until it is told to stop; connects again when the daemon comes back. */
export class PictureFeed {
  private stopped: AbortController | null = null;

  constructor(private readonly take: (picture: Picture) => void) {}

  watch(cameras: string[]): void {
    this.stop();
    if (cameras.length === 0) return;
    this.stopped = new AbortController();
    void this.run(cameras, this.stopped.signal);
  }

  stop(): void {
    this.stopped?.abort();
    this.stopped = null;
  }

  private async run(cameras: string[], signal: AbortSignal): Promise<void> {
    const query = cameras.map((camera) => `camera=${encodeURIComponent(camera)}`).join("&");
    while (!signal.aborted) {
      try {
        const answer = await fetch(`api/v1/pictures?${query}`, { signal });
        if (answer.ok && answer.body) await this.read(answer.body.getReader());
      } catch {
        // Gone, or told to stop; both are seen below.
      }
      if (!signal.aborted) await new Promise((resolve) => setTimeout(resolve, 1000));
    }
  }

  private async read(reader: ReadableStreamDefaultReader<Uint8Array>): Promise<void> {
    const parts = new Parts();
    for (;;) {
      const { done, value } = await reader.read();
      if (done || !value) return;
      for (const picture of parts.add(value)) this.take(picture);
    }
  }
}
