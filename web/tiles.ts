// SPDX-License-Identifier: Apache-2.0
// One tile for each camera: its picture, whether that is fresh, and what the daemon says of it.

import { Camera, VirtualCamera } from "./api";
import { make, setText, show } from "./dom";
import { Picture } from "./pictures";

const STALE_MS = 1500;
const RATE_MS = 2000;  // that the shown rate is taken over

export interface TileOwner {
  enlarge(name: string): void;
  point(camera: string, x: number, y: number): void;
  /** When the daemon's clock said this, by the clock of this machine [ms]. */
  toLocal(utcNs: number): number;
}

export class Tile {
  readonly element = make("article", "tile");
  readonly frame = make("div", "frame");
  private readonly canvas = make("canvas");  // pictures; also what is pointed at, under the video
  readonly video = make("video");
  private readonly note = make("p", "note", "waiting for the first picture");
  private readonly cross = make("span", "cross");
  private readonly chip = make("span", "chip");
  private readonly facts = make("p", "facts");
  private readonly problem = make("p", "problem");
  private readonly larger = make("button", "", "Enlarge");
  private readonly shown: number[] = [];  // times of the last pictures
  private latency = NaN;
  private frames = 0;
  private next: Picture | null = null;
  private decoding = false;
  private aim: [number, number];

  constructor(readonly name: string, private width: number, private height: number, private readonly owner: TileOwner) {
    this.aim = [width / 2, height / 2];
    this.canvas.width = width;
    this.canvas.height = height;
    this.canvas.setAttribute("role", "img");
    this.element.setAttribute("aria-label", `Camera ${name}`);
    this.element.dataset.camera = name;
    this.cross.hidden = this.problem.hidden = true;
    this.video.muted = this.video.autoplay = this.video.playsInline = this.video.hidden = true;
    this.video.setAttribute("aria-hidden", "true");  // the picture below says what it is
    this.video.tabIndex = -1;
    this.frame.append(this.canvas, this.video, this.note, this.cross);
    const caption = make("div", "caption");
    this.larger.type = "button";
    this.larger.setAttribute("aria-label", `Enlarge ${name}`);
    this.larger.addEventListener("click", () => owner.enlarge(name));
    caption.append(make("h3", "", name), this.chip, this.larger, this.facts, this.problem);
    this.element.append(this.frame, caption);
    this.canvas.addEventListener("click", (event) => this.owner.point(this.name, ...this.pixelOf(event)));
    this.canvas.addEventListener("keydown", (event) => this.steer(event));
  }

  take(picture: Picture): void {
    this.next = picture;  // an older one that was not shown yet is left out
    if (!this.decoding) void this.decode();
  }

  /** A frame of the video is shown, so old [ms] or NaN. */
  takeFrame(age: number): void {
    this.video.hidden = false;
    this.noteShown(age);
    this.canvas.dataset.sequence = String(++this.frames);
  }

  private noteShown(latency: number): void {
    const now = Date.now();
    this.shown.push(now);
    while (this.shown[0] < now - RATE_MS) this.shown.shift();
    this.latency = latency;
  }

  private async decode(): Promise<void> {
    this.decoding = true;
    while (this.next) {
      const picture: Picture = this.next;
      this.next = null;
      try {
        const bitmap = await createImageBitmap(picture.jpeg);
        if (this.canvas.width !== bitmap.width || this.canvas.height !== bitmap.height) {
          this.canvas.width = this.width = bitmap.width;
          this.canvas.height = this.height = bitmap.height;
        }
        this.canvas.getContext("2d")?.drawImage(bitmap, 0, 0);
        bitmap.close();
        this.video.hidden = true;
        this.noteShown(Date.now() - this.owner.toLocal(picture.utcNs));
        this.canvas.dataset.sequence = String(picture.sequence);
      } catch {
        // A picture that the browser cannot read is as good as none: the tile turns stale.
      }
    }
    this.decoding = false;
  }

  /** What the daemon says, and how old what is shown is. Call it a few times a second. */
  update(camera: Camera | VirtualCamera, linked: boolean): void {
    const now = Date.now();
    const newest = this.shown[this.shown.length - 1];
    const stale = newest === undefined || now - newest > STALE_MS || !linked;
    const real = "present" in camera ? camera : null;
    const lost = real !== null && !real.present;
    this.element.classList.toggle("stale", stale || lost);
    this.element.classList.toggle("lost", lost);
    let note = "";
    if (newest === undefined) note = lost ? "no signal" : "waiting for the first picture";
    else if (stale) note = `no picture for ${((now - newest) / 1000).toFixed(0)} s`;
    else if (lost) note = `no signal since ${(real.no_signal_since ?? "").slice(11, 19)} UTC`;
    show(this.note, note);
    this.chip.className = "chip " + (lost ? "bad" : stale ? "weak" : "good");
    setText(this.chip, lost ? "no signal" : newest === undefined ? "waiting" : stale ? "stale" : "live");
    this.canvas.setAttribute("aria-label", `Picture of ${this.name}, ${this.chip.textContent}`);
    show(this.problem, real?.problem ?? "");
    setText(this.facts, this.factsOf(camera, stale));
  }

  private factsOf(camera: Camera | VirtualCamera, stale: boolean): string {
    const kind = this.shown.length === 0 ? "" : this.video.hidden ? " as JPEG" : " as video";
    const rate = stale ? 0 : this.shown.length / (RATE_MS / 1000);
    const facts = [`shown ${rate.toFixed(0)}/s${kind}`];
    if (!stale && this.latency < 10_000) facts.push(`${Math.max(0, this.latency).toFixed(0)} ms old`);
    if ("present" in camera) {
      facts.unshift(`camera ${camera.rate_hz.toFixed(1)} Hz`);
      const dropped = [`${camera.frames_lost} by the camera`, `${camera.not_observed} in measuring`,
        `${camera.not_drawn} in drawing`].filter((text) => !text.startsWith("0 "));
      facts.push(dropped.length === 0 ? "no drops" : `dropped ${dropped.join(", ")}`);
    }
    const others = camera.viewers;
    if (others > 0) facts.push(`${others} on RTSP`);
    return facts.join(" · ");
  }

  set enlarged(one: boolean) {
    setText(this.larger, one ? "All cameras" : "Enlarge");
    this.larger.setAttribute("aria-label", one ? "Show all cameras" : `Enlarge ${this.name}`);
  }

  set pointing(on: boolean) {
    this.element.classList.toggle("pointing", on);
    if (on) this.canvas.tabIndex = 0; else this.canvas.removeAttribute("tabindex");
    if (!on) this.cross.hidden = true;
  }

  private pixelOf(event: MouseEvent): [number, number] {
    // An enlarged picture may have bars beside it.
    const box = this.canvas.getBoundingClientRect();
    const scale = Math.min(box.width / this.width, box.height / this.height);
    const left = (box.width - scale * this.width) / 2, top = (box.height - scale * this.height) / 2;
    const x = (event.clientX - box.left - left) / scale - 0.5, y = (event.clientY - box.top - top) / scale - 0.5;
    return [Math.min(Math.max(x, 0), this.width - 1), Math.min(Math.max(y, 0), this.height - 1)];
  }

  private steer(event: KeyboardEvent): void {
    const step = event.shiftKey ? 5 : 25;
    const moves: Record<string, [number, number]> = {
      ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step],
    };
    const move = moves[event.key];
    if (event.key === "Enter") this.owner.point(this.name, ...this.aim);
    if (!move && event.key !== "Enter") return;
    event.preventDefault();
    if (!move) return;
    this.aim = [Math.min(Math.max(this.aim[0] + move[0], 0), this.width - 1),
      Math.min(Math.max(this.aim[1] + move[1], 0), this.height - 1)];
    this.mark(...this.aim);
  }

  /** A cross at a pixel of the picture. */
  mark(x: number, y: number): void {
    const scale = Math.min(this.canvas.clientWidth / this.width, this.canvas.clientHeight / this.height);
    this.cross.style.left = `${(this.canvas.clientWidth - scale * this.width) / 2 + (x + 0.5) * scale}px`;
    this.cross.style.top = `${(this.canvas.clientHeight - scale * this.height) / 2 + (y + 0.5) * scale}px`;
    this.cross.hidden = false;
  }
}
